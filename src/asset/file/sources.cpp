// Sources of an asset's bytes: files, mapped files, memory.
#include <cstring>

#include "base/file.hpp"
#include "umbel/asset.hpp"

#if defined(__unix__) || defined(__APPLE__)
#define UMBEL_HAS_MMAP 1
#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>
#endif

namespace umbel {
namespace {

class FileSource : public ByteSource {
 public:
  explicit FileSource(const std::filesystem::path& path) : file_(path) {}
  uint64_t size() const override { return file_.size(); }
  void read(uint64_t offset, std::span<std::byte> out) const override { file_.read(offset, out); }

 private:
  InputFile file_;
};

class MemorySource : public ByteSource {
 public:
  explicit MemorySource(std::vector<std::byte> bytes) : bytes_(std::move(bytes)) {}
  uint64_t size() const override { return bytes_.size(); }
  void read(uint64_t offset, std::span<std::byte> out) const override {
    if (!out.empty()) std::memcpy(out.data(), bytes_.data() + offset, out.size());
  }

 private:
  std::vector<std::byte> bytes_;
};

#if defined(UMBEL_HAS_MMAP)

class MappedSource : public ByteSource {
 public:
  explicit MappedSource(const std::filesystem::path& path) {
    // Refuses what is no regular file, with a sentence.
    size_ = InputFile(path).size();
    const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    if (descriptor >= 0 && size_ > 0)
      address_ = ::mmap(nullptr, size_, PROT_READ, MAP_PRIVATE, descriptor, 0);
    if (descriptor >= 0) ::close(descriptor);
    if (descriptor < 0 || address_ == MAP_FAILED)
      throw Error(ErrorCode::kIo, "cannot map " + path.string());
  }
  MappedSource(const MappedSource&) = delete;
  ~MappedSource() override {
    if (size_ > 0) ::munmap(address_, size_);
  }
  uint64_t size() const override { return size_; }
  void read(uint64_t offset, std::span<std::byte> out) const override {
    if (!out.empty())
      std::memcpy(out.data(), static_cast<const std::byte*>(address_) + offset, out.size());
  }

 private:
  void* address_ = nullptr;
  uint64_t size_ = 0;
};

#endif

}  // namespace

std::shared_ptr<const ByteSource> open_file(const std::filesystem::path& path) {
  return std::make_shared<FileSource>(path);
}

std::shared_ptr<const ByteSource> map_file(const std::filesystem::path& path) {
#if defined(UMBEL_HAS_MMAP)
  return std::make_shared<MappedSource>(path);
#else
  return open_file(path);
#endif
}

std::shared_ptr<const ByteSource> from_memory(std::vector<std::byte> bytes) {
  return std::make_shared<MemorySource>(std::move(bytes));
}

}  // namespace umbel
