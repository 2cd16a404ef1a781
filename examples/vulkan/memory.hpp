// Buffers that shaders reach by address, and images to draw on. A renderer allocates some twenty of
// them once, so each has memory of its own; what comes and goes (pages) shares one buffer.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "device.hpp"

namespace sample {

/// kHost: mapped, for uploads and for reading back. kShared: on the device, for CUDA too.
enum class Place { kDevice, kHost, kShared };

class Buffer {
 public:
  Buffer(const Device& device, uint64_t bytes, Place place);
  ~Buffer();
  Buffer(const Buffer&) = delete;
  Buffer& operator=(const Buffer&) = delete;

  VkBuffer handle() const { return buffer_; }
  VkDeviceAddress address() const { return address_; }
  uint64_t bytes() const { return bytes_; }
  /// What a host buffer holds.
  template <class T>
  std::span<T> mapped() const {
    return {static_cast<T*>(mapped_), bytes_ / sizeof(T)};
  }
  /// Its memory as a file descriptor, of a shared buffer; whoever takes it closes it.
  int share() const;
  /// Of its memory, which may have more than the buffer.
  uint64_t allocated() const { return allocated_; }
  /// Fills the start of a device buffer and waits: for what is made once.
  void fill(std::span<const std::byte> data) const;

 private:
  const Device& device_;
  uint64_t bytes_, allocated_ = 0;
  VkBuffer buffer_ = VK_NULL_HANDLE;
  VkDeviceMemory memory_ = VK_NULL_HANDLE;
  VkDeviceAddress address_ = 0;
  void* mapped_ = nullptr;
};

/// Of the pictures that are made, and of their depths.
inline constexpr VkFormat kColorFormat = VK_FORMAT_R8G8B8A8_UNORM;
inline constexpr VkFormat kDepthFormat = VK_FORMAT_D32_SFLOAT;

class Image {
 public:
  Image(const Device& device, uint32_t width, uint32_t height, VkFormat format,
        VkImageUsageFlags usage, VkImageAspectFlags aspect);
  ~Image();
  Image(const Image&) = delete;
  Image& operator=(const Image&) = delete;
  VkImageView view() const { return view_; }
  VkImage handle() const { return image_; }
  /// Its contents need not survive if it was undefined before.
  void change_layout(VkCommandBuffer commands, VkImageLayout from, VkImageLayout to) const;

 private:
  const Device& device_;
  VkImageAspectFlags aspect_;
  VkImage image_ = VK_NULL_HANDLE;
  VkDeviceMemory memory_ = VK_NULL_HANDLE;
  VkImageView view_ = VK_NULL_HANDLE;
};

}  // namespace sample
