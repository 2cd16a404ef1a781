// The instance, the device and its one queue, with validation where its layer is installed.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "functions.hpp"

namespace sample {

struct DeviceOptions {
  bool validation = false;   ///< with synchronisation validation; throws Unavailable without layer
  bool mesh_shaders = true;  ///< if the device has them
  /// What a window needs of the instance; with any, the device can have a swapchain.
  std::vector<const char*> window_extensions;
};

struct RayLimits {
  uint32_t scratch_alignment, handle_bytes, handle_alignment;
};

class Device {
 public:
  /// Takes the first device that does. Throws Unavailable where none does.
  explicit Device(const DeviceOptions& options);
  ~Device();
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  /// Records commands, runs them once `wait` (if any) is signalled, signals `signal` (if any), and
  /// waits until they are done.
  void run(const std::function<void(VkCommandBuffer)>& record, VkSemaphore wait = VK_NULL_HANDLE,
           VkSemaphore signal = VK_NULL_HANDLE) const;

  VkInstance instance() const { return instance_; }
  VkPhysicalDevice physical() const { return physical_; }
  uint32_t family() const { return family_; }  ///< of the queue
  VkQueue queue() const { return queue_; }
  VkDevice handle() const { return device_; }
  const std::string& name() const { return name_; }
  bool mesh_shaders() const { return mesh_shaders_; }
  /// Memory and semaphores can be given to CUDA, by file descriptors.
  bool shares() const { return shares_; }
  bool ray_tracing() const { return ray_tracing_; }  ///< structures and the pipeline
  RayLimits ray_limits() const;
  bool cluster_structures() const { return cluster_structures_; }  ///< NVIDIA's, with all of that
  /// Errors and warnings that the validation layers have printed.
  uint32_t validation_messages() const { return messages_; }
  /// A memory type of the wanted properties among `types`.
  uint32_t memory_type(uint32_t types, VkMemoryPropertyFlags wanted) const;

 private:
  void make_instance(const DeviceOptions& options);
  void choose(bool mesh_shaders);
  void make_device(bool swapchain);

  VkInstance instance_ = VK_NULL_HANDLE;
  VkDebugUtilsMessengerEXT messenger_ = VK_NULL_HANDLE;
  VkPhysicalDevice physical_ = VK_NULL_HANDLE;
  uint32_t family_ = 0;
  VkDevice device_ = VK_NULL_HANDLE;
  VkQueue queue_ = VK_NULL_HANDLE;
  VkCommandPool pool_ = VK_NULL_HANDLE;
  VkCommandBuffer commands_ = VK_NULL_HANDLE;
  VkFence fence_ = VK_NULL_HANDLE;
  std::string name_;
  bool mesh_shaders_ = false, ray_tracing_ = false, cluster_structures_ = false, shares_ = false;
  uint32_t messages_ = 0;
};

/// All that was written before is seen by all that comes after. Coarse, and right: a frame of the
/// sample is a handful of passes, each of which needs what the one before made.
void wait_for_writes(VkCommandBuffer commands);

}  // namespace sample
