#include "swapchain.hpp"

#include <algorithm>

#include "unavailable.hpp"

namespace sample {

namespace {

// The sample's colours are shown as they are, so a format without a curve of its own.
VkSurfaceFormatKHR choose_format(VkPhysicalDevice device, VkSurfaceKHR surface) {
  uint32_t count = 0;
  check(vkGetPhysicalDeviceSurfaceFormatsKHR(device, surface, &count, nullptr), "formats");
  std::vector<VkSurfaceFormatKHR> formats(count);
  check(vkGetPhysicalDeviceSurfaceFormatsKHR(device, surface, &count, formats.data()), "formats");
  for (const VkSurfaceFormatKHR& format : formats) {
    if (format.format == VK_FORMAT_B8G8R8A8_UNORM || format.format == VK_FORMAT_R8G8B8A8_UNORM) {
      return format;
    }
  }
  throw Unavailable("the window has no format of 8 bits a channel.");
}

void change_layout(VkCommandBuffer commands, VkImage image, VkImageLayout from, VkImageLayout to) {
  const VkImageMemoryBarrier2 barrier{
      .sType = VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER_2,
      .srcStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT,
      .srcAccessMask = VK_ACCESS_2_MEMORY_WRITE_BIT,
      .dstStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT,
      .dstAccessMask = VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_MEMORY_WRITE_BIT,
      .oldLayout = from,
      .newLayout = to,
      .srcQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED,
      .dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED,
      .image = image,
      .subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1}};
  const VkDependencyInfo dependency{.sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO,
                                    .imageMemoryBarrierCount = 1,
                                    .pImageMemoryBarriers = &barrier};
  vkCmdPipelineBarrier2(commands, &dependency);
}

}  // namespace

Swapchain::Swapchain(const Device& device, VkSurfaceKHR surface)
    : device_(device), surface_(surface) {
  VkBool32 shows = VK_FALSE;
  check(vkGetPhysicalDeviceSurfaceSupportKHR(device.physical(), device.family(), surface, &shows),
        "the surface");
  if (shows == VK_FALSE) throw Unavailable("the device's queue cannot show pictures in a window.");
  format_ = choose_format(device.physical(), surface);
  const VkFenceCreateInfo fence{.sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO};
  check(vkCreateFence(device.handle(), &fence, nullptr, &acquired_), "the fence");
}

Swapchain::~Swapchain() {
  destroy();
  vkDestroyFence(device_.handle(), acquired_, nullptr);
  vkDestroySurfaceKHR(device_.instance(), surface_, nullptr);
}

void Swapchain::destroy() {
  if (swapchain_ == VK_NULL_HANDLE) return;
  vkDeviceWaitIdle(device_.handle());
  vkDestroySwapchainKHR(device_.handle(), swapchain_, nullptr);
  swapchain_ = VK_NULL_HANDLE;
}

bool Swapchain::resize(VkExtent2D wanted) {
  destroy();
  VkSurfaceCapabilitiesKHR can;
  check(vkGetPhysicalDeviceSurfaceCapabilitiesKHR(device_.physical(), surface_, &can),
        "the window");
  size_ = can.currentExtent.width == UINT32_MAX ? wanted : can.currentExtent;
  if (size_.width == 0 || size_.height == 0) return false;
  const uint32_t most = can.maxImageCount == 0 ? UINT32_MAX : can.maxImageCount;
  const VkSwapchainCreateInfoKHR info{.sType = VK_STRUCTURE_TYPE_SWAPCHAIN_CREATE_INFO_KHR,
                                      .surface = surface_,
                                      .minImageCount = std::min(can.minImageCount + 1, most),
                                      .imageFormat = format_.format,
                                      .imageColorSpace = format_.colorSpace,
                                      .imageExtent = size_,
                                      .imageArrayLayers = 1,
                                      .imageUsage = VK_IMAGE_USAGE_TRANSFER_DST_BIT,
                                      .imageSharingMode = VK_SHARING_MODE_EXCLUSIVE,
                                      .preTransform = can.currentTransform,
                                      .compositeAlpha = VK_COMPOSITE_ALPHA_OPAQUE_BIT_KHR,
                                      .presentMode = VK_PRESENT_MODE_FIFO_KHR,
                                      .clipped = VK_TRUE};
  check(vkCreateSwapchainKHR(device_.handle(), &info, nullptr, &swapchain_), "the swapchain");
  uint32_t count = 0;
  check(vkGetSwapchainImagesKHR(device_.handle(), swapchain_, &count, nullptr), "its images");
  images_.resize(count);
  check(vkGetSwapchainImagesKHR(device_.handle(), swapchain_, &count, images_.data()),
        "its images");
  return true;
}

bool Swapchain::show(const Image& image) {
  uint32_t index = 0;
  const VkResult acquired = vkAcquireNextImageKHR(device_.handle(), swapchain_, UINT64_MAX,
                                                  VK_NULL_HANDLE, acquired_, &index);
  if (acquired == VK_ERROR_OUT_OF_DATE_KHR) return false;
  if (acquired != VK_SUBOPTIMAL_KHR) check(acquired, "the next picture");
  check(vkWaitForFences(device_.handle(), 1, &acquired_, VK_TRUE, UINT64_MAX), "the next picture");
  check(vkResetFences(device_.handle(), 1, &acquired_), "the fence");
  device_.run([&](VkCommandBuffer commands) {
    change_layout(commands, images_[index], VK_IMAGE_LAYOUT_UNDEFINED,
                  VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL);
    const VkOffset3D end{static_cast<int32_t>(size_.width), static_cast<int32_t>(size_.height), 1};
    const VkImageBlit blit{.srcSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1},
                           .srcOffsets = {{0, 0, 0}, end},
                           .dstSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1},
                           .dstOffsets = {{0, 0, 0}, end}};
    vkCmdBlitImage(commands, image.handle(), VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, images_[index],
                   VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &blit, VK_FILTER_NEAREST);
    change_layout(commands, images_[index], VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL,
                  VK_IMAGE_LAYOUT_PRESENT_SRC_KHR);
  });
  // The commands are done, so there is nothing to wait for.
  const VkPresentInfoKHR present{.sType = VK_STRUCTURE_TYPE_PRESENT_INFO_KHR,
                                 .swapchainCount = 1,
                                 .pSwapchains = &swapchain_,
                                 .pImageIndices = &index};
  const VkResult shown = vkQueuePresentKHR(device_.queue(), &present);
  if (shown == VK_ERROR_OUT_OF_DATE_KHR || shown == VK_SUBOPTIMAL_KHR) return false;
  check(shown, "showing a picture");
  return true;
}

}  // namespace sample
