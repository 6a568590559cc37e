// Point queries answered by the kernel itself: a reference for other computations.
#include <BRepBuilderAPI_MakeVertex.hxx>
#include <BRepClass3d_SolidClassifier.hxx>
#include <BRepExtrema_DistShapeShape.hxx>
#include <BRep_Builder.hxx>
#include <TopAbs_State.hxx>
#include <TopExp_Explorer.hxx>
#include <TopoDS_Compound.hxx>
#include <gp_Pnt.hxx>

#include "kernel_content.h"

namespace mortise {
namespace brep {
namespace {

constexpr std::uint8_t kIn = 0, kOut = 1, kOn = 2, kUnknown = 3;

std::uint8_t side(TopAbs_State state, bool inside_out) {
  switch (state) {
    case TopAbs_IN:
      return inside_out ? kOut : kIn;
    case TopAbs_OUT:
      return inside_out ? kIn : kOut;
    case TopAbs_ON:
      return kOn;
    default:
      return kUnknown;
  }
}

}  // namespace

rust::Vec<std::uint8_t> Document::sides(std::size_t index, rust::Slice<const double> points,
                                        double tolerance_mm) const {
  const TopoDS_Shape& shape = content_->shapes.at(index);
  rust::Vec<std::uint8_t> out;
  out.reserve(points.size() / 3);
  if (shape.ShapeType() != TopAbs_SOLID) {
    for (std::size_t i = 0; i + 2 < points.size(); i += 3) out.push_back(kUnknown);
    return out;
  }
  BRepClass3d_SolidClassifier classifier(shape);
  // A solid whose faces point inward contains infinity; on loading it is reversed, so its sides are reversed here as
  // well.
  classifier.PerformInfinitePoint(tolerance_mm);
  const bool inside_out = classifier.State() == TopAbs_IN;
  for (std::size_t i = 0; i + 2 < points.size(); i += 3) {
    std::uint8_t found = kUnknown;
    try {
      classifier.Perform(gp_Pnt(points[i], points[i + 1], points[i + 2]), tolerance_mm);
      found = side(classifier.State(), inside_out);
    } catch (const Standard_Failure&) {
      // A ray that the kernel cannot follow leaves one point undecided.
    }
    out.push_back(found);
  }
  return out;
}

rust::Vec<double> Document::feet(std::size_t index, rust::Slice<const double> points) const {
  // Only its faces: for a solid, points inside have no distance.
  TopoDS_Compound faces;
  BRep_Builder builder;
  builder.MakeCompound(faces);
  for (TopExp_Explorer it(content_->shapes.at(index), TopAbs_FACE); it.More(); it.Next()) builder.Add(faces, it.Current());
  BRepExtrema_DistShapeShape search;
  search.LoadS2(faces);
  rust::Vec<double> out;
  out.reserve(points.size() / 3 * 4);
  for (std::size_t i = 0; i + 2 < points.size(); i += 3) {
    double found[4] = {-1, 0, 0, 0};
    try {
      search.LoadS1(BRepBuilderAPI_MakeVertex(gp_Pnt(points[i], points[i + 1], points[i + 2])).Vertex());
      if (search.Perform() && search.NbSolution() > 0) {
        found[0] = search.Value();
        for (int k = 0; k < 3; ++k) found[k + 1] = search.PointOnShape2(1).Coord(k + 1);
      }
    } catch (const Standard_Failure&) {
      // This point has no distance.
    }
    for (double value : found) out.push_back(value);
  }
  return out;
}

}  // namespace brep
}  // namespace mortise
