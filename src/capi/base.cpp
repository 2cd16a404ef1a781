// Results and errors from C (umbel_base.h): turns exceptions into results. The sentence is kept in
// memory that is there from the start, so that even running out of memory can be reported.
#include <algorithm>
#include <iterator>
#include <new>
#include <stdexcept>
#include <string_view>

#include "capi/guard.hpp"
#include "umbel/types.hpp"
#include "umbel/version.hpp"

namespace umbel::capi {
namespace {

thread_local char last_error[1024] = "";

umbel_result fail(umbel_result result, std::string_view sentence) noexcept {
  const size_t length = std::min(sentence.size(), sizeof last_error - 1);
  std::copy_n(sentence.begin(), length, last_error);
  last_error[length] = '\0';
  return result;
}

/// In the order of ErrorCode.
constexpr umbel_result kResults[] = {
    UMBEL_ERROR_INVALID_ARGUMENT, UMBEL_ERROR_INVALID_MESH, UMBEL_ERROR_IO,    UMBEL_ERROR_CORRUPT,
    UMBEL_ERROR_UNSUPPORTED,      UMBEL_ERROR_CANCELLED,    UMBEL_ERROR_DEVICE};
static_assert(std::size(kResults) == static_cast<size_t>(ErrorCode::kDevice) + 1);

umbel_result result_of(ErrorCode code) noexcept {
  const auto number = static_cast<size_t>(code);
  return number < std::size(kResults) ? kResults[number] : UMBEL_ERROR_INTERNAL;
}

}  // namespace

umbel_result report_exception() noexcept {
  try {
    throw;
  } catch (const Error& error) {
    return fail(result_of(error.code()), error.what());
  } catch (const CapacityError& error) {
    return fail(UMBEL_ERROR_CAPACITY, error.sentence);
  } catch (const std::bad_alloc&) {
    return fail(UMBEL_ERROR_OUT_OF_MEMORY, "out of memory");
  } catch (const std::length_error&) {
    // What containers throw for sizes that no memory could hold.
    return fail(UMBEL_ERROR_OUT_OF_MEMORY, "out of memory: an array would be larger than can be");
  } catch (const std::exception& error) {
    return fail(UMBEL_ERROR_INTERNAL, error.what());
  } catch (...) {
    return fail(UMBEL_ERROR_INTERNAL, "an exception of an unknown kind");
  }
}

}  // namespace umbel::capi

const char* umbel_last_error(void) { return umbel::capi::last_error; }

const char* umbel_result_name(umbel_result result) {
  switch (result) {
    case UMBEL_OK:
      return "ok";
    case UMBEL_ERROR_INVALID_ARGUMENT:
      return "invalid argument";
    case UMBEL_ERROR_INVALID_MESH:
      return "invalid mesh";
    case UMBEL_ERROR_IO:
      return "input or output failed";
    case UMBEL_ERROR_CORRUPT:
      return "corrupt data";
    case UMBEL_ERROR_UNSUPPORTED:
      return "unsupported";
    case UMBEL_ERROR_CANCELLED:
      return "cancelled";
    case UMBEL_ERROR_CAPACITY:
      return "capacity too small";
    case UMBEL_ERROR_OUT_OF_MEMORY:
      return "out of memory";
    case UMBEL_ERROR_INTERNAL:
      return "internal fault";
    case UMBEL_ERROR_DEVICE:
      return "device failed";
  }
  return "unknown result";
}

const char* umbel_version(void) { return UMBEL_VERSION; }
