// umbel::Error as umbel.Error, and umbel.Cancelled where a progress callback asked to stop.
#include "bind.hpp"

namespace umbel::python {
namespace {

const char* name_of(ErrorCode code) {
  switch (code) {
    case ErrorCode::kInvalidArgument:
      return "invalid_argument";
    case ErrorCode::kInvalidMesh:
      return "invalid_mesh";
    case ErrorCode::kIo:
      return "io";
    case ErrorCode::kCorrupt:
      return "corrupt";
    case ErrorCode::kUnsupported:
      return "unsupported";
    case ErrorCode::kCancelled:
      return "cancelled";
    case ErrorCode::kDevice:
      return "device";
  }
  return "unknown";
}

void raise(const Error& error) {
  const nb::module_ errors = nb::module_::import_("umbel.errors");
  const bool cancelled = error.code() == ErrorCode::kCancelled;
  const nb::object type = errors.attr(cancelled ? "Cancelled" : "Error");
  const nb::object value = type(error.what());
  value.attr("code") = name_of(error.code());
  PyErr_SetObject(type.ptr(), value.ptr());
}

}  // namespace

void bind_errors(nb::module_&) {
  nb::register_exception_translator([](const std::exception_ptr& pointer, void*) {
    try {
      std::rethrow_exception(pointer);
    } catch (const Error& error) {
      try {
        raise(error);
      } catch (nb::python_error& failure) {
        failure.restore();
      }
    }
  });
}

}  // namespace umbel::python
