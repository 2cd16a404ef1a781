// umbel::Error as umbel.Error, and umbel.Cancelled where a progress callback asked to stop.
#include <cstring>
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
  // What a message cites of a file may be no UTF-8.
  const char* const what = error.what();
  const auto size = static_cast<Py_ssize_t>(std::strlen(what));
  const nb::object text = nb::steal(PyUnicode_DecodeUTF8(what, size, "replace"));
  const nb::object value = type(text);
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
