// One shape as flat values: exact surfaces and curves, mass properties, tessellation welded by topology.
#include "kernel_content.h"

#include <BRepAdaptor_Curve.hxx>
#include <BRepAdaptor_Surface.hxx>
#include <BRepBndLib.hxx>
#include <BRepGProp.hxx>
#include <BRepMesh_IncrementalMesh.hxx>
#include <BRepTools.hxx>
#include <BRep_Tool.hxx>
#include <Bnd_Box.hxx>
#include <GCPnts_AbscissaPoint.hxx>
#include <GCPnts_TangentialDeflection.hxx>
#include <GProp_GProps.hxx>
#include <IMeshTools_Parameters.hxx>
#include <Poly_PolygonOnTriangulation.hxx>
#include <Poly_Triangulation.hxx>
#include <Standard_Version.hxx>
#include <TColStd_Array1OfInteger.hxx>
#include <TColStd_Array1OfReal.hxx>
#include <TColStd_HArray1OfReal.hxx>
#include <TopExp.hxx>
#include <TopExp_Explorer.hxx>
#include <TopTools_IndexedDataMapOfShapeListOfShape.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TopTools_ListOfShape.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>
#include <TopoDS_Vertex.hxx>
#include <gp_Ax3.hxx>
#include <gp_Circ.hxx>
#include <gp_Cone.hxx>
#include <gp_Cylinder.hxx>
#include <gp_Lin.hxx>
#include <gp_Pln.hxx>
#include <gp_Sphere.hxx>
#include <gp_Torus.hxx>

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace mortise {
namespace brep {
namespace {

// Parts of describing a shape: the mesh, its mass properties, and last its faces one by one.
constexpr double kMeshed = 0.7, kWeighed = 0.85;
// Effort of describing a spline face, in plain faces: it has thousands of triangles.
constexpr std::size_t kSpline = 100;
constexpr std::uint32_t kNone = 0xffffffffu;
// Relative error required of each adaptive integral; 1e-9 costs six times as much on large spline models.
constexpr double kQuadrature = 1e-6;

std::array<double, 3> numbers(const gp_XYZ& v) { return {v.X(), v.Y(), v.Z()}; }

gp_Pnt node(const Handle(Poly_Triangulation) & mesh, int index) {
#if OCC_VERSION_HEX >= 0x070600
  return mesh->Node(index);
#else
  return mesh->Nodes().Value(index);
#endif
}

gp_Pnt2d uv_node(const Handle(Poly_Triangulation) & mesh, int index) {
#if OCC_VERSION_HEX >= 0x070600
  return mesh->UVNode(index);
#else
  return mesh->UVNodes().Value(index);
#endif
}

void triangle(const Handle(Poly_Triangulation) & mesh, int index, int corners[3]) {
#if OCC_VERSION_HEX >= 0x070600
  mesh->Triangle(index).Get(corners[0], corners[1], corners[2]);
#else
  mesh->Triangles().Value(index).Get(corners[0], corners[1], corners[2]);
#endif
}

bool has_uv(const Handle(Poly_Triangulation) & mesh) {
#if OCC_VERSION_HEX >= 0x070600
  return mesh->HasUVNodes();
#else
  return mesh->HasUVNodes() == Standard_True;
#endif
}

class Describer {
 public:
  Describer(const TopoDS_Shape& shape, const std::unordered_map<const void*, Color>& colors, double linear,
            double angular)
      : shape_(shape), colors_(colors), linear_(linear), angular_(angular) {
    TopExp::MapShapes(shape, TopAbs_FACE, face_index_);
    TopExp::MapShapes(shape, TopAbs_EDGE, all_edges_);
    TopExp::MapShapes(shape, TopAbs_VERTEX, vertex_index_);
    corner_.assign(std::size_t(vertex_index_.Extent()), kNone);
    edge_number_.assign(std::size_t(all_edges_.Extent()), kNone);
    edge_nodes_.resize(std::size_t(all_edges_.Extent()));
  }

  RawShape run(const Progress& progress) {
    mass();
    progress.advance(kWeighed);
    number_edges();
    // Faces have the orientation with which they first occur in the shape.
    out_.faces.reserve(std::size_t(face_index_.Extent()));
    for (int i = 1; i <= face_index_.Extent(); ++i) {
      face(TopoDS::Face(face_index_(i)), std::uint32_t(i - 1));
      progress.advance(kWeighed + (1 - kWeighed) * i / face_index_.Extent());
    }
    for (int i = 1; i <= all_edges_.Extent(); ++i) finish_edge(i);
    return std::move(out_);
  }

 private:
  // The kernel's plain quadrature is exact on analytic faces between lines and circles, but up to 1 % off on splines
  // (such as a cylinder written as a spline): those are integrated adaptively.
  static bool is_plain(const TopoDS_Face& face) {
    if (BRepAdaptor_Surface(face, false).GetType() > GeomAbs_Torus) return false;
    for (TopExp_Explorer it(face, TopAbs_EDGE); it.More(); it.Next()) {
      const TopoDS_Edge edge = TopoDS::Edge(it.Current());
      double first = 0, last = 0;
      if (BRep_Tool::Degenerated(edge) || BRep_Tool::Curve(edge, first, last).IsNull()) continue;
      if (BRepAdaptor_Curve(edge).GetType() > GeomAbs_Circle) return false;
    }
    return true;
  }

  static double area_of(const TopoDS_Face& face) {
    GProp_GProps area;
    if (is_plain(face) || BRepGProp::SurfaceProperties(face, area, kQuadrature) < 0) {
      area = GProp_GProps();
      BRepGProp::SurfaceProperties(face, area);
    }
    return std::abs(area.Mass());
  }

  void mass() {
    bool plain = true;
    for (int i = 1; i <= face_index_.Extent() && plain; ++i) plain = is_plain(TopoDS::Face(face_index_(i)));
    GProp_GProps volume;
    if (plain || BRepGProp::VolumeProperties(shape_, volume, kQuadrature) < 0) {
      volume = GProp_GProps();
      BRepGProp::VolumeProperties(shape_, volume);
    }
    out_.volume = volume.Mass();
    out_.center = numbers(volume.CentreOfMass().XYZ());
    const gp_Mat inertia = volume.MatrixOfInertia();
    for (int row = 0; row < 3; ++row)
      for (int column = 0; column < 3; ++column) out_.inertia[3 * row + column] = inertia(row + 1, column + 1);
  }

  // Edges that degenerate to a point (the apex of a cone, the pole of a sphere) are not edges of the model.
  void number_edges() {
    std::uint32_t next = 0;
    for (int i = 1; i <= all_edges_.Extent(); ++i) {
      const TopoDS_Edge edge = TopoDS::Edge(all_edges_(i));
      if (BRep_Tool::Degenerated(edge)) continue;
      edge_number_[std::size_t(i - 1)] = next++;
      out_.edges.push_back(curve(TopoDS::Edge(edge.Oriented(TopAbs_FORWARD))));
    }
  }

  static RawEdge curve(const TopoDS_Edge& edge) {
    RawEdge raw{};
    raw.kind = 2;
    double first = 0, last = 0;
    if (BRep_Tool::Curve(edge, first, last).IsNull()) return raw;
    const BRepAdaptor_Curve adaptor(edge);
    if (adaptor.GetType() == GeomAbs_Line) {
      raw.kind = 0;
      raw.origin = numbers(adaptor.Line().Location().XYZ());
      raw.z = numbers(adaptor.Line().Direction().XYZ());
    } else if (adaptor.GetType() == GeomAbs_Circle) {
      raw.kind = 1;
      const gp_Circ circle = adaptor.Circle();
      raw.origin = numbers(circle.Location().XYZ());
      raw.x = numbers(circle.XAxis().Direction().XYZ());
      raw.z = numbers(circle.Axis().Direction().XYZ());
      raw.radius = circle.Radius();
    } else {
      // An odd number, so that a closed curve's samples do not repeat by symmetry.
      constexpr int kPieces = 31;
      first = adaptor.FirstParameter();
      last = adaptor.LastParameter();
      for (int i = 0; i <= kPieces; ++i) {
        const gp_Pnt point = adaptor.Value(first + (last - first) * i / kPieces);
        for (int k = 1; k <= 3; ++k) raw.samples.push_back(point.Coord(k));
      }
    }
    raw.length = GCPnts_AbscissaPoint::Length(adaptor);
    return raw;
  }

  static void surface(const BRepAdaptor_Surface& adaptor, RawFace& raw) {
    gp_Ax3 frame;
    raw.kind = 5;
    switch (adaptor.GetType()) {
      case GeomAbs_Plane:
        raw.kind = 0;
        frame = adaptor.Plane().Position();
        break;
      case GeomAbs_Cylinder:
        raw.kind = 1;
        frame = adaptor.Cylinder().Position();
        raw.parameters[0] = adaptor.Cylinder().Radius();
        break;
      case GeomAbs_Cone:
        raw.kind = 2;
        frame = adaptor.Cone().Position();
        raw.parameters = {adaptor.Cone().RefRadius(), adaptor.Cone().SemiAngle()};
        break;
      case GeomAbs_Sphere:
        raw.kind = 3;
        frame = adaptor.Sphere().Position();
        raw.parameters[0] = adaptor.Sphere().Radius();
        break;
      case GeomAbs_Torus:
        raw.kind = 4;
        frame = adaptor.Torus().Position();
        raw.parameters = {adaptor.Torus().MajorRadius(), adaptor.Torus().MinorRadius()};
        break;
      default:
        break;
    }
    raw.origin = numbers(frame.Location().XYZ());
    raw.x = numbers(frame.XDirection().XYZ());
    raw.z = numbers(frame.Direction().XYZ());
  }

  // Outward normal at (u, v): the kernel's natural normal, reversed if the face is.
  static void sample(const TopoDS_Face& face, const BRepAdaptor_Surface& adaptor, double u, double v, RawFace& raw) {
    gp_Pnt point;
    gp_Vec du, dv;
    adaptor.D1(u, v, point, du, dv);
    gp_Vec normal = du.Crossed(dv);
    // Where one derivative almost vanishes (a pole), their product is meaningless.
    normal = normal.Magnitude() > 1e-9 * du.Magnitude() * dv.Magnitude() ? normal.Normalized() : gp_Vec(0, 0, 0);
    if (face.Orientation() == TopAbs_REVERSED) normal.Reverse();
    raw.point = numbers(point.XYZ());
    raw.normal = numbers(normal.XYZ());
  }

  void face(const TopoDS_Face& face, std::uint32_t number) {
    RawFace raw{};
    const BRepAdaptor_Surface adaptor(face, false);
    surface(adaptor, raw);
    raw.area = area_of(face);
    out_.area += raw.area;
    const auto color = colors_.find(face.TShape().get());
    raw.has_color = color != colors_.end();
    if (raw.has_color) raw.color = color->second;

    TopLoc_Location place;
    const Handle(Poly_Triangulation) mesh = BRep_Tool::Triangulation(face, place);
    const bool meshed = !mesh.IsNull() && mesh->NbTriangles() > 0;
    std::vector<std::uint32_t> vertex_of_node;
    if (meshed) vertex_of_node.assign(std::size_t(mesh->NbNodes()), kNone);

    std::vector<bool> listed(edge_number_.size(), false);
    for (TopExp_Explorer it(face.Oriented(TopAbs_FORWARD), TopAbs_EDGE); it.More(); it.Next()) {
      const TopoDS_Edge edge = TopoDS::Edge(it.Current());
      const std::size_t index = std::size_t(all_edges_.FindIndex(edge) - 1);
      const std::uint32_t id = edge_number_[index];
      if (id != kNone) {
        // A seam occurs twice in its face, once in each direction.
        out_.edges[id].faces.push_back(number);
        if (!listed[index]) raw.edges.push_back(id);
        listed[index] = true;
      }
      if (meshed) weld(edge, index, mesh, place, vertex_of_node);
    }

    double u0, u1, v0, v1;
    BRepTools::UVBounds(face, u0, u1, v0, v1);
    double u = 0.5 * (u0 + u1), v = 0.5 * (v0 + v1);
    if (!meshed) {
      out_.faces_without_mesh.push_back(number);
    } else {
      // The middle of the first triangle lies on the face itself, for any outline.
      if (has_uv(mesh)) {
        int corners[3];
        triangle(mesh, 1, corners);
        const gp_XY sum = uv_node(mesh, corners[0]).XY() + uv_node(mesh, corners[1]).XY() + uv_node(mesh, corners[2]).XY();
        u = sum.X() / 3;
        v = sum.Y() / 3;
      }
      triangles(face, number, mesh, place, vertex_of_node);
    }
    sample(face, adaptor, u, v, raw);
    if (raw.kind == 5 && meshed && has_uv(mesh)) samples(face, adaptor, mesh, raw);
    out_.faces.push_back(std::move(raw));
  }

  // Points and outward normals over the whole face, some hundreds at most: nodes, middles of triangles, and middles of
  // sides where there are few.
  static void samples(const TopoDS_Face& face, const BRepAdaptor_Surface& adaptor, const Handle(Poly_Triangulation) & mesh,
                      RawFace& raw) {
    constexpr int kMost = 256;
    const auto add = [&](const gp_XY& uv) {
      RawFace at{};
      sample(face, adaptor, uv.X(), uv.Y(), at);
      // No normal where the parametrisation is singular.
      if (gp_XYZ(at.normal[0], at.normal[1], at.normal[2]).Modulus() < 0.5) return;
      for (double x : at.point) raw.samples.push_back(x);
      for (double x : at.normal) raw.samples.push_back(x);
    };
    for (int i = 1, step = 1 + mesh->NbNodes() / kMost; i <= mesh->NbNodes(); i += step) add(uv_node(mesh, i).XY());
    for (int i = 1, step = 1 + mesh->NbTriangles() / kMost; i <= mesh->NbTriangles(); i += step) {
      int corners[3];
      triangle(mesh, i, corners);
      const gp_XY uv[3] = {uv_node(mesh, corners[0]).XY(), uv_node(mesh, corners[1]).XY(), uv_node(mesh, corners[2]).XY()};
      add((uv[0] + uv[1] + uv[2]) / 3);
      if (mesh->NbTriangles() > kMost / 4) continue;
      for (int k = 0; k < 3; ++k) add((uv[k] + uv[(k + 1) % 3]) / 2);
    }
  }

  std::uint32_t add(const gp_Pnt& local, const TopLoc_Location& place) {
    const gp_Pnt point = local.Transformed(place.Transformation());
    const auto id = std::uint32_t(out_.vertices.size() / 3);
    for (int i = 1; i <= 3; ++i) out_.vertices.push_back(point.Coord(i));
    return id;
  }

  std::uint32_t corner(const TopoDS_Vertex& vertex, const gp_Pnt& local, const TopLoc_Location& place) {
    const int index = vertex.IsNull() ? 0 : vertex_index_.FindIndex(vertex);
    if (index == 0) return add(local, place);
    std::uint32_t& id = corner_[std::size_t(index - 1)];
    if (id == kNone) id = add(local, place);
    return id;
  }

  // Nodes of the face along one of its edges are those that the first face created for the edge: the mesher divides an
  // edge once for all its faces, in the order of its parameter.
  void weld(const TopoDS_Edge& edge, std::size_t index, const Handle(Poly_Triangulation) & mesh,
            const TopLoc_Location& place, std::vector<std::uint32_t>& vertex_of_node) {
    const Handle(Poly_PolygonOnTriangulation) polygon = BRep_Tool::PolygonOnTriangulation(edge, mesh, place);
    if (polygon.IsNull()) return;
    const TColStd_Array1OfInteger& nodes = polygon->Nodes();
    const int count = nodes.Length();
    if (count < 1) return;
    const TopoDS_Edge forward = TopoDS::Edge(edge.Oriented(TopAbs_FORWARD));
    TopoDS_Vertex first, last;
    TopExp::Vertices(forward, first, last);
    const auto at = [&](int i) { return nodes.Value(nodes.Lower() + i); };
    if (BRep_Tool::Degenerated(edge)) {
      for (int i = 0; i < count; ++i)
        vertex_of_node[std::size_t(at(i) - 1)] = corner(first.IsNull() ? last : first, node(mesh, at(i)), place);
      return;
    }
    std::vector<std::uint32_t>& shared = edge_nodes_[index];
    if (shared.empty()) {
      for (int i = 0; i < count; ++i) {
        const gp_Pnt point = node(mesh, at(i));
        if (i == 0) shared.push_back(corner(first, point, place));
        else if (i == count - 1) shared.push_back(corner(last, point, place));
        else shared.push_back(add(point, place));
      }
    }
    const bool same = std::size_t(count) == shared.size();
    for (int i = 0; i < count; ++i) {
      std::uint32_t& id = vertex_of_node[std::size_t(at(i) - 1)];
      if (id != kNone) continue;
      if (same) id = shared[std::size_t(i)];
      else if (i == 0) id = shared.front();
      else if (i == count - 1) id = shared.back();
      // A face that divided the edge differently stays open along it; the count of open edges reports it.
    }
  }

  void triangles(const TopoDS_Face& face, std::uint32_t number, const Handle(Poly_Triangulation) & mesh,
                 const TopLoc_Location& place, std::vector<std::uint32_t>& vertex_of_node) {
    // A mirrored location reverses the triangles as well as the face.
    const bool turned = (face.Orientation() == TopAbs_REVERSED) != place.Transformation().IsNegative();
    for (int i = 1; i <= mesh->NbTriangles(); ++i) {
      int corners[3];
      triangle(mesh, i, corners);
      if (turned) std::swap(corners[1], corners[2]);
      std::uint32_t ids[3];
      for (int k = 0; k < 3; ++k) {
        std::uint32_t& id = vertex_of_node[std::size_t(corners[k] - 1)];
        if (id == kNone) id = add(node(mesh, corners[k]), place);
        ids[k] = id;
      }
      // With two corners welded into one the triangle has no area, and its two other sides coincide.
      if (ids[0] == ids[1] || ids[1] == ids[2] || ids[2] == ids[0]) continue;
      for (std::uint32_t id : ids) out_.triangles.push_back(id);
      out_.triangle_face.push_back(number);
    }
  }

  void finish_edge(int index) {
    const std::uint32_t id = edge_number_[std::size_t(index - 1)];
    if (id == kNone) return;
    RawEdge& raw = out_.edges[id];
    const auto& shared = edge_nodes_[std::size_t(index - 1)];
    if (!shared.empty()) {
      for (std::uint32_t vertex : shared)
        for (std::size_t k = 0; k < 3; ++k) raw.polyline.push_back(out_.vertices[3 * std::size_t(vertex) + k]);
      return;
    }
    const TopoDS_Edge edge = TopoDS::Edge(all_edges_(index).Oriented(TopAbs_FORWARD));
    double first = 0, last = 0;
    if (BRep_Tool::Curve(edge, first, last).IsNull()) return;
    const BRepAdaptor_Curve adaptor(edge);
    const GCPnts_TangentialDeflection points(adaptor, angular_, linear_);
    for (int i = 1; i <= points.NbPoints(); ++i)
      for (int k = 1; k <= 3; ++k) raw.polyline.push_back(points.Value(i).Coord(k));
  }

  const TopoDS_Shape& shape_;
  const std::unordered_map<const void*, Color>& colors_;
  const double linear_, angular_;
  TopTools_IndexedMapOfShape face_index_, all_edges_, vertex_index_;
  std::vector<std::uint32_t> corner_;                    // mesh vertex of each B-rep vertex
  std::vector<std::uint32_t> edge_number_;               // number in the output, by index in all_edges_
  std::vector<std::vector<std::uint32_t>> edge_nodes_;   // mesh vertices along each edge
  RawShape out_{};
};

// Largest measured distance between the mesh and the exact geometry: at the middle of each segment of an edge and of
// each triangle, where a chord's error is largest.
double deviation(const TopoDS_Shape& shape) {
  double worst = 0;
  for (TopExp_Explorer faces(shape, TopAbs_FACE); faces.More(); faces.Next()) {
    const TopoDS_Face face = TopoDS::Face(faces.Current());
    TopLoc_Location place;
    const Handle(Poly_Triangulation) mesh = BRep_Tool::Triangulation(face, place);
    if (mesh.IsNull()) continue;
    const gp_Trsf trsf = place.Transformation();
    const BRepAdaptor_Surface surface(face, false);
    if (surface.GetType() != GeomAbs_Plane && has_uv(mesh)) {
      for (int i = 1; i <= mesh->NbTriangles(); ++i) {
        int corners[3];
        triangle(mesh, i, corners);
        gp_XY uv(0, 0);
        gp_XYZ points[3];
        for (int k = 0; k < 3; ++k) {
          uv += uv_node(mesh, corners[k]).XY();
          points[k] = node(mesh, corners[k]).Transformed(trsf).XYZ();
        }
        const gp_XYZ normal = (points[1] - points[0]).Crossed(points[2] - points[0]);
        const double twice_area = normal.Modulus();
        if (twice_area < 1e-12) continue;
        const gp_XYZ middle = surface.Value(uv.X() / 3, uv.Y() / 3).XYZ();
        worst = std::max(worst, std::abs((middle - points[0]).Dot(normal)) / twice_area);
      }
    }
    for (TopExp_Explorer edges(face, TopAbs_EDGE); edges.More(); edges.Next()) {
      const TopoDS_Edge edge = TopoDS::Edge(edges.Current());
      double first = 0, last = 0;
      if (BRep_Tool::Degenerated(edge) || BRep_Tool::Curve(edge, first, last).IsNull()) continue;
      const Handle(Poly_PolygonOnTriangulation) polygon = BRep_Tool::PolygonOnTriangulation(edge, mesh, place);
      if (polygon.IsNull() || polygon->Parameters().IsNull()) continue;
      const BRepAdaptor_Curve curve(edge);
      const TColStd_Array1OfInteger& nodes = polygon->Nodes();
      const TColStd_Array1OfReal& parameters = polygon->Parameters()->Array1();
      for (int i = 0; i + 1 < nodes.Length(); ++i) {
        const gp_XYZ a = node(mesh, nodes(nodes.Lower() + i)).Transformed(trsf).XYZ();
        const gp_XYZ b = node(mesh, nodes(nodes.Lower() + i + 1)).Transformed(trsf).XYZ();
        const double length = (b - a).Modulus();
        if (length < 1e-12) continue;
        const double middle = 0.5 * (parameters(parameters.Lower() + i) + parameters(parameters.Lower() + i + 1));
        const gp_XYZ off = curve.Value(middle).XYZ() - a;
        worst = std::max(worst, off.Crossed(b - a).Modulus() / length);
      }
    }
  }
  return worst;
}

}  // namespace

std::size_t Document::effort(std::size_t index) const {
  std::size_t sum = 0;
  for (TopExp_Explorer it(content_->shapes.at(index), TopAbs_FACE); it.More(); it.Next())
    sum += BRepAdaptor_Surface(TopoDS::Face(it.Current()), false).GetType() > GeomAbs_Torus ? kSpline : 1;
  return sum;
}

RawShape describe(const TopoDS_Shape& shape, const std::unordered_map<const void*, Color>& colors, double linear_mm,
                  double relative, double angular_rad, const Progress& progress) {
  double linear = linear_mm;
  if (!(linear > 0)) {
    Bnd_Box box;
    BRepBndLib::Add(shape, box, false);
    linear = box.IsVoid() ? 0.1 : relative * std::sqrt(box.SquareExtent());
    if (!(linear > 1e-6)) linear = 1e-6;
  }
  // The mesher can miss its bound on splines, so the error is measured and a finer mesh requested. The error decreases
  // with the square of a segment's length; if it does not decrease, the geometry is faulty and a finer mesh would only
  // grow without limit.
  IMeshTools_Parameters ask;
  ask.Deflection = linear;
  ask.Angle = angular_rad;
  double found = 0;
  for (int attempt = 0; attempt < 4; ++attempt) {
    // Discard meshes left from an earlier call or read from the file.
    BRepTools::Clean(shape);
    const Handle(Indicator) indicator = new Indicator(progress, 0, kMeshed);
    BRepMesh_IncrementalMesh mesher(shape, ask, indicator->Start());
    const double before = found;
    found = deviation(shape);
    if (found <= 1.01 * linear || (attempt > 0 && found > 0.8 * before)) break;
    const double shrink = std::max(0.25, 0.9 * linear / found);
    ask.Deflection *= shrink;
    ask.Angle *= std::sqrt(shrink);
  }
  RawShape out = Describer(shape, colors, linear, angular_rad).run(progress);
  out.deflection = found;
  out.deflection_asked = linear;
  return out;
}

}  // namespace brep
}  // namespace mortise
