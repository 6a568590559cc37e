// Writing: shapes at given placements to STEP text.
#include <Interface_Static.hxx>
#include <Quantity_Color.hxx>
#include <STEPCAFControl_Writer.hxx>
#include <StepData_Protocol.hxx>
#include <StepData_StepModel.hxx>
#include <StepData_StepWriter.hxx>
#include <TCollection_ExtendedString.hxx>
#include <TDF_Label.hxx>
#include <TDataStd_Name.hxx>
#include <TDocStd_Document.hxx>
#include <XCAFDoc_ColorTool.hxx>
#include <XCAFDoc_DocumentTool.hxx>
#include <XCAFDoc_ShapeTool.hxx>
#include <XSControl_WorkSession.hxx>
#include <gp_Trsf.hxx>

#include <sstream>
#include <stdexcept>
#include <unordered_map>

#include "kernel_content.h"

namespace mortise {
namespace brep {
namespace {

TCollection_ExtendedString text(const rust::String& name) {
  // Second argument true: the bytes are UTF-8.
  return TCollection_ExtendedString(std::string(name).c_str(), true);
}

}  // namespace

rust::Vec<std::uint8_t> Document::write(const rust::Vec<RawPlace>& places) const {
  Handle(TDocStd_Document) document = new TDocStd_Document("MDTV-XCAF");
  const Handle(XCAFDoc_ShapeTool) shapes = XCAFDoc_DocumentTool::ShapeTool(document->Main());
  const Handle(XCAFDoc_ColorTool) colors = XCAFDoc_DocumentTool::ColorTool(document->Main());
  const TDF_Label root = shapes->NewShape();
  TDataStd_Name::Set(root, "assembly");
  std::unordered_map<std::size_t, TDF_Label> products;
  for (const RawPlace& place : places) {
    auto product = products.find(place.shape);
    if (product == products.end()) {
      const TDF_Label label = shapes->AddShape(content_->shapes.at(place.shape), false);
      TDataStd_Name::Set(label, text(place.name));
      product = products.emplace(place.shape, label).first;
    }
    const auto& m = place.placement;
    gp_Trsf where;
    where.SetValues(m[0], m[1], m[2], m[3], m[4], m[5], m[6], m[7], m[8], m[9], m[10], m[11]);
    const TDF_Label component = shapes->AddComponent(root, product->second, TopLoc_Location(where));
    TDataStd_Name::Set(component, text(place.name));
    if (place.has_color) {
      const Quantity_Color color(place.color[0], place.color[1], place.color[2], Quantity_TOC_RGB);
      colors->SetColor(component, color, XCAFDoc_ColorGen);
    }
  }
  shapes->UpdateAssemblies();
  STEPCAFControl_Writer writer;
  writer.SetColorMode(true);
  writer.SetNameMode(true);
  Interface_Static::SetCVal("write.step.unit", "MM");
  Interface_Static::SetCVal("write.step.schema", "AP214IS");
  if (!writer.Transfer(document, STEPControl_AsIs)) throw std::runtime_error("it cannot write the assembly");
  const Handle(StepData_Protocol) protocol =
      Handle(StepData_Protocol)::DownCast(writer.ChangeWriter().WS()->Protocol());
  StepData_StepWriter text_writer(writer.ChangeWriter().Model());
  text_writer.SendModel(protocol);
  std::ostringstream out;
  if (protocol.IsNull() || !text_writer.Print(out)) throw std::runtime_error("it cannot write the text");
  const std::string bytes = out.str();
  rust::Vec<std::uint8_t> result;
  result.reserve(bytes.size());
  for (const char byte : bytes) result.push_back(std::uint8_t(byte));
  return result;
}

}  // namespace brep
}  // namespace mortise
