// Geometry without a closed form, as exactly as the kernel can provide it: free-form surfaces as splines, free-form
// edges as points.
#include <BRepAdaptor_Curve.hxx>
#include <BRepAdaptor_Surface.hxx>
#include <BRepTools.hxx>
#include <BRep_Tool.hxx>
#include <GeomAPI_ProjectPointOnSurf.hxx>
#include <GeomConvert.hxx>
#include <Geom_BSplineSurface.hxx>
#include <Geom_RectangularTrimmedSurface.hxx>
#include <Poly_PolygonOnTriangulation.hxx>
#include <Poly_Triangulation.hxx>
#include <TColStd_Array1OfReal.hxx>
#include <TColStd_HArray1OfReal.hxx>
#include <TopExp.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>

#include <algorithm>
#include <cmath>

#include "kernel_content.h"

namespace mortise {
namespace brep {
namespace {

// Samples along each parameter for measuring the deviation of a converted surface.
constexpr int kSamples = 8;
// Most bisections of a mesh side.
constexpr int kMaxHalvings = 8;

// Splines and Bezier patches convert to splines exactly, extrusions and revolutions within rounding, offsets within
// 1e-4.
Handle(Geom_BSplineSurface) spline_of(const TopoDS_Face& face) {
  const Handle(Geom_Surface) surface = BRep_Tool::Surface(face);
  double u0, u1, v0, v1;
  BRepTools::UVBounds(face, u0, u1, v0, v1);
  double a0, a1, b0, b1;
  surface->Bounds(a0, a1, b0, b1);
  if (!surface->IsUPeriodic()) u0 = std::max(u0, a0), u1 = std::min(u1, a1);
  if (!surface->IsVPeriodic()) v0 = std::max(v0, b0), v1 = std::min(v1, b1);
  Handle(Geom_BSplineSurface) spline;
  try {
    spline = GeomConvert::SurfaceToBSplineSurface(new Geom_RectangularTrimmedSurface(surface, u0, u1, v0, v1));
  } catch (const Standard_Failure&) {
    // The surface may not trim to the outline of the face; the whole surface serves as well.
    spline = GeomConvert::SurfaceToBSplineSurface(surface);
  }
  if (spline->IsUPeriodic()) spline->SetUNotPeriodic();
  if (spline->IsVPeriodic()) spline->SetVNotPeriodic();
  return spline;
}

double deviation_of(const TopoDS_Face& face, const Handle(Geom_BSplineSurface) & spline) {
  const BRepAdaptor_Surface adaptor(face, false);
  if (adaptor.GetType() == GeomAbs_BSplineSurface || adaptor.GetType() == GeomAbs_BezierSurface) return 0;
  const Handle(Geom_Surface) surface = BRep_Tool::Surface(face);
  double u0, u1, v0, v1, worst = 0;
  BRepTools::UVBounds(face, u0, u1, v0, v1);
  for (int i = 0; i <= kSamples; ++i) {
    for (int j = 0; j <= kSamples; ++j) {
      const gp_Pnt point = surface->Value(u0 + (u1 - u0) * i / kSamples, v0 + (v1 - v0) * j / kSamples);
      const GeomAPI_ProjectPointOnSurf foot(point, spline);
      if (foot.NbPoints() > 0) worst = std::max(worst, foot.LowerDistance());
    }
  }
  return worst;
}

void append_knots(const TColStd_Array1OfReal& sequence, rust::Vec<double>& out) {
  for (int i = sequence.Lower(); i <= sequence.Upper(); ++i) out.push_back(sequence.Value(i));
}

RawSpline describe_spline(const TopoDS_Face& face, std::uint32_t number) {
  const Handle(Geom_BSplineSurface) spline = spline_of(face);
  RawSpline raw{};
  raw.face = number;
  raw.degrees = {std::uint32_t(spline->UDegree()), std::uint32_t(spline->VDegree())};
  append_knots(spline->UKnotSequence(), raw.knots_u);
  append_knots(spline->VKnotSequence(), raw.knots_v);
  // The weights of a polynomial surface are undefined (zero) once it was periodic.
  const bool rational = spline->IsURational() || spline->IsVRational();
  for (int i = 1; i <= spline->NbUPoles(); ++i) {
    for (int j = 1; j <= spline->NbVPoles(); ++j) {
      for (int k = 1; k <= 3; ++k) raw.poles.push_back(spline->Pole(i, j).Coord(k));
      raw.poles.push_back(rational ? spline->Weight(i, j) : 1.0);
    }
  }
  raw.deviation = deviation_of(face, spline);
  return raw;
}

// Appends points strictly between two parameters so that each chord is within the tolerance of the curve at its middle.
void refine(const BRepAdaptor_Curve& curve, double t0, const gp_XYZ& p0, double t1, const gp_XYZ& p1, double tolerance,
            int depth, rust::Vec<double>& out, std::uint32_t& count) {
  const double t = 0.5 * (t0 + t1);
  const gp_XYZ p = curve.Value(t).XYZ();
  const gp_XYZ chord = p1 - p0;
  const double length = chord.Modulus();
  const double off = length > 0 ? (p - p0).Crossed(chord).Modulus() / length : (p - p0).Modulus();
  // A point of inflection at the middle would appear straight: the first bisection is always made.
  if (depth == kMaxHalvings || (depth > 0 && off <= tolerance)) return;
  refine(curve, t0, p0, t, p, tolerance, depth + 1, out, count);
  for (int k = 1; k <= 3; ++k) out.push_back(p.Coord(k));
  ++count;
  refine(curve, t, p, t1, p1, tolerance, depth + 1, out, count);
}

RawCurve describe_curve(const TopoDS_Edge& edge, std::uint32_t number, double tolerance) {
  RawCurve raw{};
  raw.edge = number;
  Handle(Poly_PolygonOnTriangulation) polygon;
  Handle(Poly_Triangulation) mesh;
  TopLoc_Location place;
  BRep_Tool::PolygonOnTriangulation(edge, polygon, mesh, place);
  if (polygon.IsNull() || polygon->Parameters().IsNull()) return raw;
  const TColStd_Array1OfReal& parameters = polygon->Parameters()->Array1();
  const BRepAdaptor_Curve curve(edge);
  for (int i = parameters.Lower(); i < parameters.Upper(); ++i) {
    std::uint32_t count = 0;
    const double t0 = parameters.Value(i), t1 = parameters.Value(i + 1);
    refine(curve, t0, curve.Value(t0).XYZ(), t1, curve.Value(t1).XYZ(), tolerance, 0, raw.points, count);
    raw.counts.push_back(count);
  }
  return raw;
}

}  // namespace

RawFreeForms Document::free_forms(std::size_t index, double tolerance_mm) const {
  const TopoDS_Shape& shape = content_->shapes.at(index);
  RawFreeForms out{};
  TopTools_IndexedMapOfShape faces, edges;
  TopExp::MapShapes(shape, TopAbs_FACE, faces);
  TopExp::MapShapes(shape, TopAbs_EDGE, edges);
  for (int i = 1; i <= faces.Extent(); ++i) {
    const TopoDS_Face face = TopoDS::Face(faces(i));
    if (BRepAdaptor_Surface(face, false).GetType() <= GeomAbs_Torus) continue;
    try {
      out.splines.push_back(describe_spline(face, std::uint32_t(i - 1)));
    } catch (const Standard_Failure&) {
      // The face keeps its tessellation.
    }
  }
  std::uint32_t number = 0;
  for (int i = 1; i <= edges.Extent(); ++i) {
    const TopoDS_Edge edge = TopoDS::Edge(edges(i).Oriented(TopAbs_FORWARD));
    if (BRep_Tool::Degenerated(edge)) continue;
    const std::uint32_t id = number++;
    double first = 0, last = 0;
    if (BRep_Tool::Curve(edge, first, last).IsNull()) continue;
    if (BRepAdaptor_Curve(edge).GetType() <= GeomAbs_Circle) continue;
    try {
      out.curves.push_back(describe_curve(edge, id, tolerance_mm));
    } catch (const Standard_Failure&) {
      // The edge keeps its polyline.
    }
  }
  return out;
}

}  // namespace brep
}  // namespace mortise
