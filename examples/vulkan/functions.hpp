// Vulkan's functions, found at run time, so that the program starts, and says what is missing, on
// machines without a Vulkan loader.
#pragma once

#define VK_NO_PROTOTYPES
#include <vulkan/vulkan.h>

#ifndef VK_NV_cluster_acceleration_structure
#error The sample needs newer Vulkan headers, such as 1.4.309 of Debian 13.
#endif

// Every function that the sample calls.
#define SAMPLE_INSTANCE_FUNCTIONS(X)          \
  X(vkDestroyInstance)                        \
  X(vkEnumeratePhysicalDevices)               \
  X(vkGetPhysicalDeviceProperties)            \
  X(vkGetPhysicalDeviceProperties2)           \
  X(vkGetPhysicalDeviceFeatures2)             \
  X(vkGetPhysicalDeviceMemoryProperties)      \
  X(vkGetPhysicalDeviceQueueFamilyProperties) \
  X(vkEnumerateDeviceExtensionProperties)     \
  X(vkCreateDebugUtilsMessengerEXT)           \
  X(vkDestroyDebugUtilsMessengerEXT)          \
  X(vkCreateDevice)                           \
  X(vkGetDeviceProcAddr)

#define SAMPLE_DEVICE_FUNCTIONS(X) \
  X(vkDestroyDevice)               \
  X(vkDeviceWaitIdle)              \
  X(vkGetDeviceQueue)              \
  X(vkCreateCommandPool)           \
  X(vkDestroyCommandPool)          \
  X(vkAllocateCommandBuffers)      \
  X(vkResetCommandPool)            \
  X(vkBeginCommandBuffer)          \
  X(vkEndCommandBuffer)            \
  X(vkQueueSubmit2)                \
  X(vkCreateFence)                 \
  X(vkDestroyFence)                \
  X(vkWaitForFences)               \
  X(vkCreateSemaphore)             \
  X(vkDestroySemaphore)            \
  X(vkResetFences)                 \
  X(vkCreateBuffer)                \
  X(vkDestroyBuffer)               \
  X(vkGetBufferMemoryRequirements) \
  X(vkGetBufferDeviceAddress)      \
  X(vkCreateImage)                 \
  X(vkDestroyImage)                \
  X(vkGetImageMemoryRequirements)  \
  X(vkCreateImageView)             \
  X(vkDestroyImageView)            \
  X(vkAllocateMemory)              \
  X(vkFreeMemory)                  \
  X(vkBindBufferMemory)            \
  X(vkBindImageMemory)             \
  X(vkMapMemory)                   \
  X(vkCreateShaderModule)          \
  X(vkDestroyShaderModule)         \
  X(vkCreatePipelineLayout)        \
  X(vkDestroyPipelineLayout)       \
  X(vkCreateComputePipelines)      \
  X(vkCreateGraphicsPipelines)     \
  X(vkDestroyPipeline)             \
  X(vkCmdBindPipeline)             \
  X(vkCmdPushConstants)            \
  X(vkCmdDispatch)                 \
  X(vkCmdDispatchIndirect)         \
  X(vkCmdDrawIndirect)             \
  X(vkCmdFillBuffer)               \
  X(vkCmdUpdateBuffer)             \
  X(vkCmdCopyBuffer)               \
  X(vkCmdCopyImageToBuffer)        \
  X(vkCmdBlitImage)                \
  X(vkCmdCopyBufferToImage)        \
  X(vkCmdPipelineBarrier2)         \
  X(vkCmdBeginRendering)           \
  X(vkCmdEndRendering)             \
  X(vkCmdSetViewport)              \
  X(vkCmdSetScissor)

// Null where the device or the instance lacks the extension.
#define SAMPLE_OPTIONAL_FUNCTIONS(X)                  \
  X(vkCmdDrawMeshTasksIndirectEXT)                    \
  X(vkCreateSwapchainKHR)                             \
  X(vkDestroySwapchainKHR)                            \
  X(vkGetSwapchainImagesKHR)                          \
  X(vkAcquireNextImageKHR)                            \
  X(vkQueuePresentKHR)                                \
  X(vkCreateAccelerationStructureKHR)                 \
  X(vkDestroyAccelerationStructureKHR)                \
  X(vkGetAccelerationStructureBuildSizesKHR)          \
  X(vkGetAccelerationStructureDeviceAddressKHR)       \
  X(vkCmdBuildAccelerationStructuresKHR)              \
  X(vkCreateRayTracingPipelinesKHR)                   \
  X(vkGetRayTracingShaderGroupHandlesKHR)             \
  X(vkCmdTraceRaysKHR)                                \
  X(vkGetClusterAccelerationStructureBuildSizesNV)    \
  X(vkCmdBuildClusterAccelerationStructureIndirectNV) \
  X(vkGetMemoryFdKHR)                                 \
  X(vkGetSemaphoreFdKHR)

#define SAMPLE_SURFACE_FUNCTIONS(X)            \
  X(vkDestroySurfaceKHR)                       \
  X(vkGetPhysicalDeviceSurfaceSupportKHR)      \
  X(vkGetPhysicalDeviceSurfaceCapabilitiesKHR) \
  X(vkGetPhysicalDeviceSurfaceFormatsKHR)

#define SAMPLE_DECLARE(name) inline PFN_##name name = nullptr;
namespace sample {
inline PFN_vkGetInstanceProcAddr vkGetInstanceProcAddr = nullptr;
inline PFN_vkCreateInstance vkCreateInstance = nullptr;
inline PFN_vkEnumerateInstanceLayerProperties vkEnumerateInstanceLayerProperties = nullptr;
SAMPLE_INSTANCE_FUNCTIONS(SAMPLE_DECLARE)
SAMPLE_DEVICE_FUNCTIONS(SAMPLE_DECLARE)
SAMPLE_OPTIONAL_FUNCTIONS(SAMPLE_DECLARE)
SAMPLE_SURFACE_FUNCTIONS(SAMPLE_DECLARE)

/// Throws Unavailable where there is no loader.
void load_global_functions();
void load_instance_functions(VkInstance instance);
void load_device_functions(VkDevice device);

/// Throws a sentence for anything but success.
void check(VkResult result, const char* what);
}  // namespace sample
#undef SAMPLE_DECLARE
