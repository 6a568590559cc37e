// Content of a Document between reading and tessellation.
#pragma once

#include <Message_ProgressIndicator.hxx>
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

// Reports the progress of one operation of the kernel as the part from begin to end of the present phase.
class Indicator : public Message_ProgressIndicator {
 public:
  Indicator(const Progress& progress, double begin, double end) : progress_(progress), begin_(begin), end_(end) {}

 protected:
  void Show(const Message_ProgressScope&, const Standard_Boolean) override {
    progress_.advance(begin_ + (end_ - begin_) * GetPosition());
  }

 private:
  const Progress& progress_;
  const double begin_, end_;
};

RawShape describe(const TopoDS_Shape& shape, const std::unordered_map<const void*, Color>& colors, double linear_mm,
                  double relative, double angular_rad, const Progress& progress);

}  // namespace brep
}  // namespace mortise
