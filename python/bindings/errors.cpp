// umbel::Error as umbel.Error, and umbel.Cancelled where a progress callback asked to stop.
#include <iterator>

#include "bind.hpp"

namespace umbel::python {
namespace {

/// In the order of ErrorCode.
constexpr const char* kNames[] = {"invalid_argument", "invalid_mesh", "io",    "corrupt",
                                  "unsupported",      "cancelled",    "device"};
static_assert(std::size(kNames) == static_cast<size_t>(ErrorCode::kDevice) + 1);

void raise(const Error& error) {
  const nb::module_ errors = nb::module_::import_("umbel.errors");
  const bool cancelled = error.code() == ErrorCode::kCancelled;
  const nb::object type = errors.attr(cancelled ? "Cancelled" : "Error");
  const nb::object value = type(error.what());
  value.attr("code") = kNames[static_cast<size_t>(error.code())];
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
