// Reading: STEP text to shapes, placements, names and colours.
#include "kernel_content.h"

#include <BRepBuilderAPI_Transform.hxx>
#include <IFSelect_ReturnStatus.hxx>
#include <Interface_Check.hxx>
#include <Interface_InterfaceModel.hxx>
#include <Interface_Static.hxx>
#include <Message.hxx>
#include <Message_Messenger.hxx>
#include <Message_Printer.hxx>
#include <Quantity_Color.hxx>
#include <Standard_Version.hxx>
#include <STEPCAFControl_Reader.hxx>
#include <STEPControl_Reader.hxx>
#include <StepData_StepModel.hxx>
#include <StepShape_FaceBasedSurfaceModel.hxx>
#include <StepShape_FaceSurface.hxx>
#include <StepShape_ShellBasedSurfaceModel.hxx>
#include <StepShape_SolidModel.hxx>
#include <TCollection_AsciiString.hxx>
#include <TCollection_ExtendedString.hxx>
#include <TDF_Label.hxx>
#include <TDF_LabelSequence.hxx>
#include <TDataStd_Name.hxx>
#include <TDocStd_Document.hxx>
#include <TopExp_Explorer.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Iterator.hxx>
#include <TransferBRep.hxx>
#include <Transfer_Binder.hxx>
#include <Transfer_TransientProcess.hxx>
#include <XCAFDoc_ColorTool.hxx>
#include <XCAFDoc_DocumentTool.hxx>
#include <XCAFDoc_ShapeTool.hxx>
#include <XSControl_TransferReader.hxx>
#include <XSControl_WorkSession.hxx>
#include <gp_Trsf.hxx>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <locale>
#include <map>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <tuple>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#if defined(__unix__) || defined(__APPLE__)
#include <sys/resource.h>
#endif
#if defined(__linux__)
#include <sys/prctl.h>
#include <unistd.h>

#include <csignal>
#endif

namespace mortise {
namespace brep {
namespace {

std::string name_of(const TDF_Label& label) {
  Handle(TDataStd_Name) name;
  if (!label.FindAttribute(TDataStd_Name::GetID(), name)) return std::string();
  // Second argument 0: non-ASCII characters are written as UTF-8.
  return std::string(TCollection_AsciiString(name->Get(), 0).ToCString());
}

bool color_of(const Handle(XCAFDoc_ColorTool) & tool, const TDF_Label& label, Color& color) {
  Quantity_Color found;
  for (XCAFDoc_ColorType type : {XCAFDoc_ColorSurf, XCAFDoc_ColorGen, XCAFDoc_ColorCurv}) {
    if (tool->GetColor(label, type, found)) {
      double r, g, b;
      found.Values(r, g, b, Quantity_TOC_RGB);
      color = {float(r), float(g), float(b)};
      return true;
    }
  }
  return false;
}

// A token may end in * and a signed scale: see part21/operators.rs.
TopLoc_Location scale_of(const std::string& token) {
  const std::size_t star = token.find('*');
  if (star == std::string::npos || token.compare(0, 8, "mortise-") != 0) return TopLoc_Location();
  double scale = 1;
  std::istringstream number(token.substr(star + 1));
  number.imbue(std::locale::classic());
  if (!(number >> scale) || scale == 0 || scale == 1) return TopLoc_Location();
  gp_Trsf about_origin;
  about_origin.SetScale(gp_Pnt(0, 0, 0), scale);
  return TopLoc_Location(about_origin);
}

std::size_t count(const TopoDS_Shape& shape, TopAbs_ShapeEnum what, TopAbs_ShapeEnum outside_of = TopAbs_SHAPE) {
  std::size_t n = 0;
  for (TopExp_Explorer it(shape, what, outside_of); it.More(); it.Next()) ++n;
  return n;
}

// Placements with a scale or a mirror are handled below, so they must not throw here.
TopoDS_Shape moved(const TopoDS_Shape& shape, const TopLoc_Location& where) {
#if OCC_VERSION_HEX >= 0x070600
  return shape.Moved(where, false);
#else
  return shape.Moved(where);
#endif
}

// A leaf found below a product: a solid, or the rest of the product when it has none.
struct Leaf {
  TopoDS_Shape shape;
  std::vector<std::pair<std::string, std::string>> path;
  bool has_color = false;
  Color color{};
};

class Walker {
 public:
  Walker(Document::Content& content, const Handle(XCAFDoc_ShapeTool) & shapes,
         const Handle(XCAFDoc_ColorTool) & colors, std::size_t max_parts)
      : content_(content), shapes_(shapes), colors_(colors), max_parts_(max_parts) {}

  void run() {
    TDF_LabelSequence all;
    shapes_->GetShapes(all);
    for (int i = 1; i <= all.Length(); ++i) learn(all.Value(i));
    TDF_LabelSequence roots;
    shapes_->GetFreeShapes(roots);
    // A product that another one maps into itself (no occurrence is written for it) is a definition, not a root.
    std::unordered_set<const void*> mapped;
    for (int i = 1; i <= roots.Length(); ++i) collect_nested(XCAFDoc_ShapeTool::GetShape(roots.Value(i)), mapped, true);
    for (int i = 1; i <= roots.Length(); ++i) {
      const TDF_Label label = roots.Value(i);
      const TopoDS_Shape shape = XCAFDoc_ShapeTool::GetShape(label);
      if (shape.IsNull() || (!XCAFDoc_ShapeTool::IsAssembly(label) && mapped.count(shape.TShape().get()) != 0)) continue;
      // A root that consists of a single placed item is a reference to it: its own shape includes the placement.
      TDF_Label product = label;
      TopLoc_Location where;
      if (XCAFDoc_ShapeTool::GetReferredShape(label, product)) where = XCAFDoc_ShapeTool::GetLocation(label);
      Path path{{std::string(), name_of(label)}};
      if (product != label && name_of(product) != path.back().second) path.emplace_back(std::string(), name_of(product));
      Color color{};
      const bool has = color_of(colors_, label, color) || color_of(colors_, product, color);
      walk(product, where, path, has, color, 0);
    }
  }

  const std::unordered_set<const void*>& placed() const { return placed_; }

 private:
  using Path = std::vector<std::pair<std::string, std::string>>;
  static constexpr int kMaxDepth = 200;

  // Stores names and colours by identity of the geometry.
  void learn(const TDF_Label& label) {
    const TopoDS_Shape shape = XCAFDoc_ShapeTool::GetShape(label);
    if (shape.IsNull()) return;
    products_[shape.TShape().get()] = name_of(label);
    Color color{};
    if (color_of(colors_, label, color)) content_.colors[shape.TShape().get()] = color;
    TDF_LabelSequence parts;
    if (XCAFDoc_ShapeTool::GetSubShapes(label, parts)) {
      for (int i = 1; i <= parts.Length(); ++i) {
        const TopoDS_Shape part = XCAFDoc_ShapeTool::GetShape(parts.Value(i));
        if (!part.IsNull() && color_of(colors_, parts.Value(i), color)) content_.colors[part.TShape().get()] = color;
      }
    }
  }

  void collect_nested(const TopoDS_Shape& shape, std::unordered_set<const void*>& into, bool top, int depth = 0) const {
    if (shape.IsNull() || depth > kMaxDepth) return;
    if (!top) into.insert(shape.TShape().get());
    if (shape.ShapeType() != TopAbs_COMPOUND && shape.ShapeType() != TopAbs_COMPSOLID) return;
    for (TopoDS_Iterator it(shape); it.More(); it.Next()) collect_nested(it.Value(), into, false, depth + 1);
  }

  void walk(const TDF_Label& label, const TopLoc_Location& where, Path& path, bool has_color, Color color, int depth) {
    if (depth > kMaxDepth) throw std::runtime_error("assembly nested deeper than 200 levels");
    if (XCAFDoc_ShapeTool::IsAssembly(label)) {
      TDF_LabelSequence components;
      XCAFDoc_ShapeTool::GetComponents(label, components);
      for (int i = 1; i <= components.Length(); ++i) {
        const TDF_Label component = components.Value(i);
        TDF_Label product;
        if (!XCAFDoc_ShapeTool::GetReferredShape(component, product)) continue;
        Color own = color;
        const bool has = color_of(colors_, component, own) || color_of(colors_, product, own) || has_color;
        path.emplace_back(name_of(component), name_of(product));
        const TopLoc_Location here = where * XCAFDoc_ShapeTool::GetLocation(component) * scale_of(path.back().first);
        walk(product, here, path, has, own, depth + 1);
        path.pop_back();
      }
      return;
    }
    const TopoDS_Shape shape = XCAFDoc_ShapeTool::GetShape(label);
    if (shape.IsNull()) return;
    std::vector<Leaf> leaves;
    solids(moved(shape, where), path, has_color, color, leaves, 0);
    std::size_t loose = count(shape, TopAbs_FACE, TopAbs_SOLID);
    if (leaves.empty()) {
      if (loose == 0) return;
      Leaf leaf;
      leaf.shape = moved(shape, where);
      leaf.path = path;
      leaf.has_color = own_color(shape, has_color, color, leaf.color);
      leaves.push_back(leaf);
      loose = 0;
    }
    // Number the solids within the innermost product that contains them.
    std::map<Path, std::size_t> total, seen;
    for (const Leaf& leaf : leaves) ++total[leaf.path];
    for (const Leaf& leaf : leaves) {
      place(leaf, seen[leaf.path]++, total[leaf.path], loose);
      loose = 0;
    }
  }

  bool own_color(const TopoDS_Shape& shape, bool inherited, const Color& color, Color& out) const {
    const auto own = content_.colors.find(shape.TShape().get());
    out = own == content_.colors.end() ? color : own->second;
    return inherited || own != content_.colors.end();
  }

  void solids(const TopoDS_Shape& shape, Path& path, bool has_color, const Color& color, std::vector<Leaf>& out,
              int depth) {
    if (depth > kMaxDepth) throw std::runtime_error("shape nested deeper than 200 levels");
    if (shape.ShapeType() == TopAbs_SOLID) {
      Leaf leaf;
      leaf.shape = shape;
      leaf.path = path;
      leaf.has_color = own_color(shape, has_color, color, leaf.color);
      out.push_back(leaf);
      if (content_.parts.size() + out.size() > max_parts_) throw std::runtime_error("more parts than the limit allows");
      return;
    }
    if (shape.ShapeType() != TopAbs_COMPOUND && shape.ShapeType() != TopAbs_COMPSOLID) return;
    Color mine{};
    const bool has = own_color(shape, has_color, color, mine);
    for (TopoDS_Iterator it(shape); it.More(); it.Next()) {
      const auto product = products_.find(it.Value().TShape().get());
      // A mapped product keeps its name.
      const bool named = product != products_.end() && product->second != path.back().second;
      if (named) path.emplace_back(std::string(), product->second);
      solids(it.Value(), path, has, mine, out, depth + 1);
      if (named) path.pop_back();
    }
  }

  void place(const Leaf& leaf, std::size_t solid, std::size_t total, std::size_t loose) {
    for (TopExp_Explorer it(leaf.shape, TopAbs_FACE); it.More(); it.Next()) placed_.insert(it.Current().TShape().get());
    const gp_Trsf trsf = leaf.shape.Location().Transformation();
    const double scale = trsf.ScaleFactor();
    const bool rigid = std::abs(scale - 1.0) < 1e-12;
    // Shapes are equal when their geometry, sense and scale (negative: mirrored) are equal.
    const Key key{leaf.shape.TShape().get(), int(leaf.shape.Orientation()), rigid ? 1.0 : scale};
    auto known = known_.find(key);
    if (known == known_.end()) {
      TopoDS_Shape own = leaf.shape.Located(TopLoc_Location());
      if (!rigid) {
        gp_Trsf about_origin;
        about_origin.SetScale(gp_Pnt(0, 0, 0), scale);
        own = BRepBuilderAPI_Transform(own, about_origin, true).Shape();
        for (TopExp_Explorer was(leaf.shape, TopAbs_FACE), now(own, TopAbs_FACE); was.More() && now.More();
             was.Next(), now.Next()) {
          const auto color = content_.colors.find(was.Current().TShape().get());
          if (color != content_.colors.end()) {
            const Color copy = color->second;
            content_.colors[now.Current().TShape().get()] = copy;
          }
        }
      }
      known = known_.emplace(key, content_.shapes.size()).first;
      content_.shapes.push_back(own);
    }
    RawPart part;
    for (const auto& link : leaf.path) part.path.push_back(RawLink{rust::String::lossy(link.first), rust::String::lossy(link.second)});
    part.shape = known->second;
    part.solid = solid;
    part.solids = total;
    const gp_Mat rotation = trsf.HVectorialPart();
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) part.placement[4 * row + column] = rotation(row + 1, column + 1);
      part.placement[4 * row + 3] = trsf.TranslationPart().Coord(row + 1);
    }
    part.has_color = leaf.has_color;
    part.color = leaf.color;
    part.loose_faces = loose;
    content_.parts.push_back(part);
  }

  using Key = std::tuple<const void*, int, double>;
  Document::Content& content_;
  const Handle(XCAFDoc_ShapeTool) & shapes_;
  const Handle(XCAFDoc_ColorTool) & colors_;
  const std::size_t max_parts_;
  std::unordered_map<const void*, std::string> products_;
  std::map<Key, std::size_t> known_;
  std::unordered_set<const void*> placed_;
};

// Sense of each face in the text, by the identity of its geometry.
using Senses = std::unordered_map<const void*, bool>;

Senses senses(const Handle(StepData_StepModel) & model, const Handle(Transfer_TransientProcess) & process) {
  Senses found;
  for (int i = 1; i <= model->NbEntities(); ++i) {
    const Handle(StepShape_FaceSurface) entity = Handle(StepShape_FaceSurface)::DownCast(model->Value(i));
    if (entity.IsNull()) continue;
    const TopoDS_Shape shape = TransferBRep::ShapeResult(process, entity);
    if (shape.IsNull()) continue;
    for (TopExp_Explorer it(shape, TopAbs_FACE); it.More(); it.Next())
      found[it.Current().TShape().get()] = entity->SameSense();
  }
  return found;
}

// See RawResult::turned.
std::size_t turned(const TopoDS_Shape& shape, const Senses& senses) {
  std::size_t sum = 0;
  for (TopExp_Explorer solid(shape, TopAbs_SOLID); solid.More(); solid.Next()) {
    // A cavity may have its shell reversed as a whole, so each shell is judged by itself.
    for (TopExp_Explorer shell(solid.Current(), TopAbs_SHELL); shell.More(); shell.Next()) {
      std::size_t all = 0, other = 0;
      for (TopExp_Explorer face(shell.Current(), TopAbs_FACE); face.More(); face.Next()) {
        const auto sense = senses.find(face.Current().TShape().get());
        if (sense == senses.end()) continue;
        ++all;
        if ((face.Current().Orientation() == TopAbs_FORWARD) != sense->second) ++other;
      }
      if (other < all) sum += other;
    }
  }
  return sum;
}

// Result for each solid and surface model.
rust::Vec<RawResult> outcome(const Handle(XSControl_WorkSession) & session, const std::unordered_set<const void*>& placed) {
  rust::Vec<RawResult> results;
  const Handle(StepData_StepModel) model = Handle(StepData_StepModel)::DownCast(session->Model());
  const Handle(Transfer_TransientProcess) process = session->TransferReader()->TransientProcess();
  if (model.IsNull() || process.IsNull()) return results;
  const Senses faces = senses(model, process);
  for (int i = 1; i <= model->NbEntities(); ++i) {
    const Handle(Standard_Transient) entity = model->Value(i);
    if (!entity->IsKind(STANDARD_TYPE(StepShape_SolidModel)) &&
        !entity->IsKind(STANDARD_TYPE(StepShape_ShellBasedSurfaceModel)) &&
        !entity->IsKind(STANDARD_TYPE(StepShape_FaceBasedSurfaceModel)))
      continue;
    RawResult result{};
    result.entity = std::size_t(model->IdentLabel(entity));
    const TopoDS_Shape shape = TransferBRep::ShapeResult(process, entity);
    if (!shape.IsNull()) {
      result.faces = count(shape, TopAbs_FACE);
      result.solids = count(shape, TopAbs_SOLID);
      result.turned = turned(shape, faces);
      for (TopExp_Explorer it(shape, TopAbs_FACE); it.More() && !result.placed; it.Next())
        result.placed = placed.count(it.Current().TShape().get()) != 0;
    }
    const Handle(Transfer_Binder) binder = process->Find(entity);
    if (!binder.IsNull()) {
      const Handle(Interface_Check) check = binder->Check();
      if (!check.IsNull() && check->NbFails() > 0) result.message = rust::String::lossy(check->CFail(1));
    }
    results.push_back(result);
  }
  return results;
}

// Share of parsing in reading a document; the rest is the transfer.
constexpr double kParsing = 0.4;
// Part of its range that the kernel passes while it transfers shapes, as measured; it jumps over the rest at the end.
constexpr double kTransferring = 0.25;

// A stream over memory, without a copy, that reports how much of the text has been taken.
class View : public std::streambuf {
 public:
  View(rust::Slice<const std::uint8_t> text, const Progress& progress) : progress_(progress) {
    begin_ = reinterpret_cast<char*>(const_cast<std::uint8_t*>(text.data()));
    end_ = begin_ + text.size();
    setg(begin_, begin_, begin_);
  }

 protected:
  int_type underflow() override {
    if (egptr() == end_) return traits_type::eof();
    progress_.advance(kParsing * double(egptr() - begin_) / double(end_ - begin_));
    setg(egptr(), egptr(), egptr() + std::min<std::ptrdiff_t>(end_ - egptr(), 1 << 16));
    return traits_type::to_int_type(*gptr());
  }

 private:
  const Progress& progress_;
  char *begin_, *end_;
};

}  // namespace

Document::Document(std::unique_ptr<Content> content) : content_(std::move(content)) {}
Document::~Document() = default;
rust::Vec<RawPart> Document::parts() const { return content_->parts; }
rust::Vec<RawResult> Document::results() const { return content_->results; }
std::size_t Document::shape_count() const { return content_->shapes.size(); }
RawShape Document::shape(std::size_t index, double linear_mm, double relative, double angular_rad,
                         const Progress& progress) const {
  return describe(content_->shapes.at(index), content_->colors, linear_mm, relative, angular_rad, progress);
}

std::unique_ptr<Document> read_document(rust::Slice<const std::uint8_t> text, std::size_t max_parts,
                                        const Progress& progress) {
  // The kernel writes to standard output, which belongs to the program.
  Message::DefaultMessenger()->ChangePrinters().Clear();
  STEPCAFControl_Reader reader;
  Interface_Static::SetCVal("xstep.cascade.unit", "MM");
  reader.SetColorMode(true);
  reader.SetNameMode(true);
  reader.SetLayerMode(false);
  reader.SetPropsMode(false);
  View view(text, progress);
  std::istream stream(&view);
  const IFSelect_ReturnStatus status = reader.ChangeReader().ReadStream("model.step", stream);
  if (status != IFSelect_RetDone) throw std::runtime_error("the kernel cannot parse it");
  Handle(TDocStd_Document) document = new TDocStd_Document("MDTV-XCAF");
  // The tools of the document's main label must exist before the transfer fills them.
  XCAFDoc_DocumentTool::ShapeTool(document->Main());
  const Handle(Indicator) indicator = new Indicator(progress, kParsing, kParsing + (1 - kParsing) / kTransferring);
  const bool transferred = reader.Transfer(document, indicator->Start());
  auto content = std::make_unique<Document::Content>();
  const Handle(XCAFDoc_ShapeTool) shapes = XCAFDoc_DocumentTool::ShapeTool(document->Main());
  const Handle(XCAFDoc_ColorTool) colors = XCAFDoc_DocumentTool::ColorTool(document->Main());
  Walker walker(*content, shapes, colors, max_parts);
  if (transferred) walker.run();
  content->results = outcome(reader.Reader().WS(), walker.placed());
  return std::make_unique<Document>(std::move(content));
}

bool limit_process(std::uint64_t memory_bytes, std::uint64_t cpu_seconds) {
#if defined(__unix__) || defined(__APPLE__)
  bool done = true;
  const auto cap = [&done](int resource, std::uint64_t value) {
    rlimit limit{};
    if (getrlimit(resource, &limit) != 0) {
      done = false;
      return;
    }
    if (limit.rlim_max != RLIM_INFINITY && value > limit.rlim_max) value = limit.rlim_max;
    limit.rlim_cur = value;
    done = setrlimit(resource, &limit) == 0 && done;
  };
  if (memory_bytes != 0) cap(RLIMIT_AS, memory_bytes);
  if (cpu_seconds != 0) cap(RLIMIT_CPU, cpu_seconds);
  cap(RLIMIT_CORE, 0);
  return done;
#else
  (void)memory_bytes;
  (void)cpu_seconds;
  return false;
#endif
}

void end_with_parent(std::uint32_t parent) {
#if defined(__linux__)
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  // If the parent ended before the call, no signal comes.
  if (std::uint32_t(getppid()) != parent) end_now();
#else
  (void)parent;
#endif
}

void end_now() { std::_Exit(3); }

void flush_output() {
  std::cout.flush();
  std::fflush(stdout);
}

}  // namespace brep
}  // namespace mortise
