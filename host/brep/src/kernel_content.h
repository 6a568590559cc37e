// Content of a Document between reading and tessellation.
#pragma once

#include <TopoDS_Shape.hxx>

#include <array>
#include <unordered_map>
#include <vector>

#include "kernel.h"
#include "mortise-brep/src/kernel.rs.h"

namespace mortise {
namespace brep {

using Color = std::array<float, 3>;

struct Document::Content {
  std::vector<TopoDS_Shape> shapes;
  rust::Vec<RawPart> parts;
  rust::Vec<RawResult> results;
  // Colour of a face, by the identity of its geometry.
  std::unordered_map<const void*, Color> colors;
};

RawShape describe(const TopoDS_Shape& shape, const std::unordered_map<const void*, Color>& colors, double linear_mm,
                  double relative, double angular_rad);

}  // namespace brep
}  // namespace mortise
