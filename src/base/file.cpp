// Positional reads rather than a memory map: a disk error, or a file that another process cuts
// short, is then an error with a sentence and not a signal.
#include "base/file.hpp"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <string>
#include <system_error>
#include <utility>

#include "umbel/types.hpp"

#if defined(__unix__) || defined(__APPLE__)
#define UMBEL_POSIX_FILES 1
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#else
#include <process.h>

#include <fstream>
#include <mutex>
#endif

namespace umbel {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const std::string& what, const fs::path& path, int error) {
  throw Error(ErrorCode::kIo,
              what + " " + path.string() + ": " + std::generic_category().message(error));
}

[[noreturn]] void fail_not_regular(const fs::path& path) {
  throw Error(ErrorCode::kIo, path.string() + " is not a regular file");
}

/// Where the bytes will go: through a link, so that it stays one.
fs::path resolved_target(const fs::path& path) {
  std::error_code ignored;
  const fs::file_status status = fs::status(path, ignored);
  // A link to what is not there yet; one that leads to itself has no type.
  if (status.type() == fs::file_type::not_found && fs::is_symlink(path, ignored))
    return resolved_target(path.parent_path() / fs::read_symlink(path));
  if (!fs::exists(status)) return path;
  // Renaming onto a device or a folder would replace it.
  if (!fs::is_regular_file(status)) fail_not_regular(path);
  const fs::path real = fs::canonical(path, ignored);
  return real.empty() ? path : real;
}

fs::path temporary_name(const fs::path& target, unsigned long process) {
  static std::atomic<unsigned> counter{0};
  // Names may have 255 bytes; a long one is cut so that the additions still fit.
  const std::string name = target.filename().string().substr(0, 200);
  return target.parent_path() /
         ("." + name + "." + std::to_string(process) + "." + std::to_string(counter++) + ".tmp");
}

fs::path temporary_folder(const fs::path& folder) {
  return folder.empty() ? fs::temp_directory_path() : folder;
}

[[noreturn]] void fail_shortened(const fs::path& path) {
  throw Error(ErrorCode::kCorrupt, path.string() + " has become shorter while it was read");
}

}  // namespace

#if defined(UMBEL_POSIX_FILES)

namespace {

struct Descriptor {
  int descriptor = -1;
  Descriptor() = default;
  Descriptor(const Descriptor&) = delete;
  ~Descriptor() {
    if (descriptor >= 0) ::close(descriptor);
  }
};

void read_all(int descriptor, const fs::path& path, uint64_t offset, std::span<std::byte> out) {
  while (!out.empty()) {
    const ssize_t count = ::pread(descriptor, out.data(), out.size(), static_cast<off_t>(offset));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) fail("cannot read", path, errno);
    if (count == 0) fail_shortened(path);
    offset += static_cast<uint64_t>(count);
    out = out.subspan(static_cast<size_t>(count));
  }
}

void write_all(int descriptor, const fs::path& path, uint64_t offset,
               std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t count =
        ::pwrite(descriptor, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) fail("cannot write", path, count < 0 ? errno : ENOSPC);
    offset += static_cast<uint64_t>(count);
    bytes = bytes.subspan(static_cast<size_t>(count));
  }
}

/// A new file beside `target`, open for `access`; `path` is for errors.
int create_beside(const fs::path& target, const fs::path& path, int access, fs::path& name) {
  int descriptor = -1;
  do {
    name = temporary_name(target, static_cast<unsigned long>(::getpid()));
    descriptor = ::open(name.c_str(), access | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  } while (descriptor < 0 && errno == EEXIST);
  if (descriptor < 0) fail("cannot write", path, errno);
  return descriptor;
}

}  // namespace

struct InputFile::Handle : Descriptor {};

InputFile::InputFile(const fs::path& path) : path_(path), handle_(std::make_unique<Handle>()) {
  // Without O_NONBLOCK a named pipe would wait here for somebody to write to it.
  handle_->descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (handle_->descriptor < 0) fail("cannot open", path, errno);
  struct stat status;
  if (::fstat(handle_->descriptor, &status) != 0) fail("cannot read", path, errno);
  if (!S_ISREG(status.st_mode)) fail_not_regular(path);
  size_ = static_cast<uint64_t>(status.st_size);
}

void InputFile::read(uint64_t offset, std::span<std::byte> out) const {
  read_all(handle_->descriptor, path_, offset, out);
}

struct OutputFile::Handle : Descriptor {};

OutputFile::OutputFile(const fs::path& path)
    : target_(resolved_target(path)), handle_(std::make_unique<Handle>()) {
  handle_->descriptor = create_beside(target_, path, O_WRONLY, temporary_);
}

void OutputFile::write(uint64_t offset, std::span<const std::byte> bytes) {
  write_all(handle_->descriptor, target_, offset, bytes);
}

void OutputFile::commit() {
  if (::fsync(handle_->descriptor) != 0 && errno != EINVAL && errno != ENOTSUP)
    fail("cannot write", target_, errno);
  commit_unflushed();
  // The name itself is durable once the folder is; where folders cannot be flushed, it follows.
  const fs::path folder = target_.has_parent_path() ? target_.parent_path() : fs::path(".");
  if (const int descriptor = ::open(folder.c_str(), O_RDONLY | O_CLOEXEC); descriptor >= 0) {
    ::fsync(descriptor);
    ::close(descriptor);
  }
}

void OutputFile::commit_unflushed() {
  if (::close(std::exchange(handle_->descriptor, -1)) != 0) fail("cannot write", target_, errno);
  if (::rename(temporary_.c_str(), target_.c_str()) != 0) fail("cannot write", target_, errno);
  temporary_.clear();
}

struct TemporaryFile::Handle : Descriptor {};

TemporaryFile::TemporaryFile(const fs::path& folder) : handle_(std::make_unique<Handle>()) {
  const fs::path in = temporary_folder(folder);
  handle_->descriptor = create_beside(in / "umbel", in, O_RDWR, path_);
  ::unlink(path_.c_str());
}

void TemporaryFile::append(std::span<const std::byte> bytes) {
  write_all(handle_->descriptor, path_, size_, bytes);
  size_ += bytes.size();
}

void TemporaryFile::read(uint64_t offset, std::span<std::byte> out) const {
  read_all(handle_->descriptor, path_, offset, out);
}

TemporaryFile::~TemporaryFile() = default;

#else

struct InputFile::Handle {
  std::ifstream stream;
  std::mutex mutex;
};

InputFile::InputFile(const fs::path& path) : path_(path), handle_(std::make_unique<Handle>()) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) fail("cannot open", path, ENOENT);
  if (!fs::is_regular_file(status)) fail_not_regular(path);
  handle_->stream.open(path, std::ios::binary);
  if (!handle_->stream) fail("cannot open", path, errno);
  size_ = fs::file_size(path);
}

void InputFile::read(uint64_t offset, std::span<std::byte> out) const {
  const std::lock_guard lock(handle_->mutex);
  handle_->stream.clear();
  handle_->stream.seekg(static_cast<std::streamoff>(offset));
  handle_->stream.read(reinterpret_cast<char*>(out.data()),
                       static_cast<std::streamsize>(out.size()));
  if (!handle_->stream) fail_shortened(path_);
}

struct OutputFile::Handle {
  std::ofstream stream;
};

OutputFile::OutputFile(const fs::path& path)
    : target_(resolved_target(path)), handle_(std::make_unique<Handle>()) {
  do {
    temporary_ = temporary_name(target_, static_cast<unsigned long>(::_getpid()));
  } while (fs::exists(temporary_));
  handle_->stream.open(temporary_, std::ios::binary | std::ios::trunc);
  if (!handle_->stream) fail("cannot write", path, errno);
}

void OutputFile::write(uint64_t offset, std::span<const std::byte> bytes) {
  handle_->stream.seekp(static_cast<std::streamoff>(offset));
  handle_->stream.write(reinterpret_cast<const char*>(bytes.data()),
                        static_cast<std::streamsize>(bytes.size()));
  if (!handle_->stream) fail("cannot write", target_, errno);
}

void OutputFile::commit() { commit_unflushed(); }

void OutputFile::commit_unflushed() {
  handle_->stream.close();
  if (!handle_->stream) fail("cannot write", target_, errno);
  std::error_code error;
  fs::rename(temporary_, target_, error);
  if (error)
    throw Error(ErrorCode::kIo, "cannot write " + target_.string() + ": " + error.message());
  temporary_.clear();
}

struct TemporaryFile::Handle {
  std::fstream stream;
};

TemporaryFile::TemporaryFile(const fs::path& folder) : handle_(std::make_unique<Handle>()) {
  do {
    path_ =
        temporary_name(temporary_folder(folder) / "umbel", static_cast<unsigned long>(::_getpid()));
  } while (fs::exists(path_));
  handle_->stream.open(path_, std::ios::binary | std::ios::in | std::ios::out | std::ios::trunc);
  if (!handle_->stream) fail("cannot write", path_, errno);
}

void TemporaryFile::append(std::span<const std::byte> bytes) {
  handle_->stream.seekp(static_cast<std::streamoff>(size_));
  handle_->stream.write(reinterpret_cast<const char*>(bytes.data()),
                        static_cast<std::streamsize>(bytes.size()));
  if (!handle_->stream) fail("cannot write", path_, errno);
  size_ += bytes.size();
}

void TemporaryFile::read(uint64_t offset, std::span<std::byte> out) const {
  handle_->stream.seekg(static_cast<std::streamoff>(offset));
  handle_->stream.read(reinterpret_cast<char*>(out.data()),
                       static_cast<std::streamsize>(out.size()));
  if (!handle_->stream) fail_shortened(path_);
}

TemporaryFile::~TemporaryFile() {
  handle_.reset();
  std::error_code ignored;
  fs::remove(path_, ignored);
}

#endif

InputFile::~InputFile() = default;

OutputFile::~OutputFile() {
  if (temporary_.empty()) return;
  handle_.reset();
  std::error_code ignored;
  fs::remove(temporary_, ignored);
}

}  // namespace umbel
