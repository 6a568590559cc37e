// The interface to the CAD kernel, as flat values. See kernel.rs for the meaning of each field.
#pragma once

#include <Standard_Failure.hxx>

#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>

#include "rust/cxx.h"

// Before version 8 the kernel's exceptions do not derive from std::exception: each one is turned into an error here.
namespace rust {
namespace behavior {
template <typename Try, typename Fail>
static void trycatch(Try&& func, Fail&& fail) noexcept try {
  func();
} catch (const Standard_Failure& failure) {
  const char* what = failure.GetMessageString();
  fail(what != nullptr && *what != 0 ? what : failure.DynamicType()->Name());
} catch (const std::exception& failure) {
  fail(failure.what());
} catch (...) {
  fail("unknown C++ exception");
}
}  // namespace behavior
}  // namespace rust

namespace mortise {
namespace brep {

struct RawPart;
struct RawResult;
struct RawShape;
struct RawFreeForms;
struct RawPlace;
struct Progress;

// A STEP file after transfer: its distinct shapes and where they are placed.
class Document {
 public:
  struct Content;
  explicit Document(std::unique_ptr<Content> content);
  ~Document();
  rust::Vec<RawPart> parts() const;
  rust::Vec<RawResult> results() const;
  std::size_t shape_count() const;
  std::size_t effort(std::size_t index) const;
  RawShape shape(std::size_t index, double linear_mm, double relative, double angular_rad,
                 const Progress& progress) const;
  RawFreeForms free_forms(std::size_t index, double tolerance_mm) const;
  rust::Vec<std::uint8_t> sides(std::size_t index, rust::Slice<const double> points, double tolerance_mm) const;
  rust::Vec<double> feet(std::size_t index, rust::Slice<const double> points) const;
  rust::Vec<std::uint8_t> write(const rust::Vec<RawPlace>& places) const;

 private:
  std::unique_ptr<Content> content_;
};

std::unique_ptr<Document> read_document(rust::Slice<const std::uint8_t> text, std::size_t max_parts,
                                        const Progress& progress);
bool limit_process(std::uint64_t memory_bytes, std::uint64_t cpu_seconds);
void flush_output();
void end_with_parent(std::uint32_t parent);
void end_now();

}  // namespace brep
}  // namespace mortise
