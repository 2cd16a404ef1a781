// A window's pictures: copies a drawn image to the next of them, and shows it.
#pragma once

#include <vector>

#include "memory.hpp"

namespace sample {

class Swapchain {
 public:
  /// Takes over the surface. Throws Unavailable if the device's queue cannot show pictures on it.
  Swapchain(const Device& device, VkSurfaceKHR surface);
  ~Swapchain();
  Swapchain(const Swapchain&) = delete;
  Swapchain& operator=(const Swapchain&) = delete;

  /// Makes pictures of the surface's size as it is now, or of `wanted` where the surface takes any.
  /// False where it has none, as while a window is minimised.
  bool resize(VkExtent2D wanted);
  VkExtent2D size() const { return size_; }
  /// Shows an image in the layout for transfers from it, of the same size. False if the surface has
  /// changed: resize first.
  bool show(const Image& image);

 private:
  void destroy();

  const Device& device_;
  VkSurfaceKHR surface_;
  VkSurfaceFormatKHR format_{};
  VkSwapchainKHR swapchain_ = VK_NULL_HANDLE;
  VkFence acquired_ = VK_NULL_HANDLE;
  VkExtent2D size_{};
  std::vector<VkImage> images_;
};

}  // namespace sample
