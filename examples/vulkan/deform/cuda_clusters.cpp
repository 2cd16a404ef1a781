#include "deform/cuda_clusters.hpp"

#include <algorithm>
#include <cstring>
#include <numeric>
#include <stdexcept>
#include <string>

#include "unavailable.hpp"

namespace sample {

namespace {

void check_cuda(cudaError_t error, const char* what) {
  if (error == cudaSuccess) return;
  throw std::runtime_error(std::string(what) + " failed: " + cudaGetErrorString(error) + ".");
}

// The device of CUDA that is Vulkan's.
int same_device(const Device& device) {
  VkPhysicalDeviceIDProperties ids{.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ID_PROPERTIES};
  VkPhysicalDeviceProperties2 all{.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2,
                                  .pNext = &ids};
  vkGetPhysicalDeviceProperties2(device.physical(), &all);
  int count = 0;
  if (!device.shares() || cudaGetDeviceCount(&count) != cudaSuccess) count = 0;
  for (int d = 0; d < count; ++d) {
    cudaDeviceProp properties{};
    check_cuda(cudaGetDeviceProperties(&properties, d), "a device's properties");
    if (std::memcmp(&properties.uuid, ids.deviceUUID, VK_UUID_SIZE) == 0) return d;
  }
  throw Unavailable("CUDA does not have Vulkan's device.");
}

}  // namespace

CudaClusters::CudaClusters(const Device& device, const umbel::Mesh& mesh, uint32_t max_triangles)
    : device_((check_cuda(cudaSetDevice(same_device(device)), "CUDA's device"), device)),
      size_(static_cast<uint32_t>(mesh.triangles.size())),
      config_{.method = umbel::FrameMethod::kMorton, .max_triangles = max_triangles},
      most_(umbel::max_frame_clusters(size_, config_)),
      moved_(device, mesh, max_triangles, Place::kShared),
      triangles_(device, 12 * uint64_t{size_}, Place::kShared),
      items_(device, 4 * uint64_t{size_}, Place::kShared),
      offsets_(device, 4 * (uint64_t{most_} + 1), Place::kHost) {
  check_cuda(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking), "a stream");
  positions_ = map(moved_.positions());
  shared_triangles_ = map(triangles_);
  shared_items_ = map(items_);
  has_moved_ = make_signal();
  has_clustered_ = make_signal();
  source_ = allocate<uint32_t>(3 * size_t{size_});
  check_cuda(cudaMemcpy(source_, mesh.triangles.data(), 12 * size_t{size_}, cudaMemcpyHostToDevice),
             "a copy");
  current_ = allocate_clusters();
  other_ = allocate_clusters();
  areas_ = {allocate<uint64_t>(most_), allocate<uint64_t>(most_), allocate<uint64_t>(2)};
  other_areas_ = {areas_.now, allocate<uint64_t>(most_), areas_.total};
}

CudaClusters::~CudaClusters() {
  cudaStreamSynchronize(stream_);
  for (const Mapped& mapped : {positions_, shared_triangles_, shared_items_}) {
    cudaFree(mapped.pointer);
    cudaDestroyExternalMemory(mapped.memory);
  }
  for (const Signal& signal : {has_moved_, has_clustered_}) {
    cudaDestroyExternalSemaphore(signal.cuda);
    vkDestroySemaphore(device_.handle(), signal.vulkan, nullptr);
  }
  for (void* pointer : allocated_) cudaFree(pointer);
  cudaFree(scratch_);
  cudaStreamDestroy(stream_);
}

CudaClusters::Mapped CudaClusters::map(const Buffer& buffer) const {
  cudaExternalMemoryHandleDesc memory{};
  memory.type = cudaExternalMemoryHandleTypeOpaqueFd;
  memory.handle.fd = buffer.share();  // CUDA's from now on
  memory.size = buffer.allocated();
  memory.flags = cudaExternalMemoryDedicated;
  Mapped mapped;
  check_cuda(cudaImportExternalMemory(&mapped.memory, &memory), "the import of memory");
  cudaExternalMemoryBufferDesc whole{};
  whole.size = buffer.bytes();
  check_cuda(cudaExternalMemoryGetMappedBuffer(&mapped.pointer, mapped.memory, &whole),
             "mapped memory");
  return mapped;
}

CudaClusters::Signal CudaClusters::make_signal() const {
  constexpr auto kFile = VK_EXTERNAL_SEMAPHORE_HANDLE_TYPE_OPAQUE_FD_BIT;
  const VkExportSemaphoreCreateInfo exported{
      .sType = VK_STRUCTURE_TYPE_EXPORT_SEMAPHORE_CREATE_INFO, .handleTypes = kFile};
  const VkSemaphoreCreateInfo info{.sType = VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO,
                                   .pNext = &exported};
  Signal signal;
  check(vkCreateSemaphore(device_.handle(), &info, nullptr, &signal.vulkan), "a semaphore");
  const VkSemaphoreGetFdInfoKHR file{.sType = VK_STRUCTURE_TYPE_SEMAPHORE_GET_FD_INFO_KHR,
                                     .semaphore = signal.vulkan,
                                     .handleType = kFile};
  cudaExternalSemaphoreHandleDesc given{};
  given.type = cudaExternalSemaphoreHandleTypeOpaqueFd;
  check(vkGetSemaphoreFdKHR(device_.handle(), &file, &given.handle.fd), "a shared semaphore");
  check_cuda(cudaImportExternalSemaphore(&signal.cuda, &given), "the import of a semaphore");
  return signal;
}

template <class T>
T* CudaClusters::allocate(size_t count) {
  void* pointer = nullptr;
  check_cuda(cudaMalloc(&pointer, std::max<size_t>(count, 1) * sizeof(T)), "device memory");
  allocated_.push_back(pointer);
  return static_cast<T*>(pointer);
}

umbel::cuda::DeviceClusters CudaClusters::allocate_clusters() {
  return {allocate<uint32_t>(size_), allocate<uint32_t>(3 * size_t{size_}),
          allocate<uint32_t>(size_t{most_} + 1), allocate<umbel::Aabb>(most_),
          allocate<uint32_t>(1)};
}

umbel::cuda::DeviceMesh CudaClusters::mesh() const {
  return {.positions = positions_.pointer, .indices = source_, .triangles = size_};
}

void CudaClusters::deform(float time) {
  // A signal that nobody has taken must be taken before it is given again.
  wait_for_vulkan();
  moved_.deform(time, has_moved_.vulkan);
  moved_unseen_ = true;
}

void CudaClusters::wait_for_vulkan() {
  if (!moved_unseen_) return;
  const cudaExternalSemaphoreWaitParams once{};
  check_cuda(cudaWaitExternalSemaphoresAsync(&has_moved_.cuda, &once, 1, stream_), "waiting");
  moved_unseen_ = false;
}

template <class Work>
void CudaClusters::run(const Work& work) {
  size_t bytes = 0;
  work(nullptr, bytes);
  if (bytes > scratch_bytes_) {
    check_cuda(cudaStreamSynchronize(stream_), "the stream");
    cudaFree(scratch_);
    check_cuda(cudaMalloc(&scratch_, bytes), "scratch memory");
    scratch_bytes_ = bytes;
  }
  work(scratch_, bytes);
}

void CudaClusters::build() {
  wait_for_vulkan();
  run([&](void* scratch, size_t& bytes) {
    umbel::cuda::build_frame_clusters(scratch, bytes, mesh(), config_, current_, stream_);
  });
  run([&](void* scratch, size_t& bytes) {
    umbel::cuda::measure_frame_clusters(scratch, bytes, size_, config_, current_, areas_, true,
                                        stream_);
  });
  kept_.clear();
  hand_over();
  growth_.rebuilt(boxes(), {});
}

void CudaClusters::refit() {
  wait_for_vulkan();
  run([&](void* scratch, size_t& bytes) {
    umbel::cuda::refit_frame_clusters(scratch, bytes, mesh(), config_, current_, areas_, stream_);
  });
  kept_.resize(count());
  std::iota(kept_.begin(), kept_.end(), 0u);
  hand_over();
  growth_.measure(boxes());
}

void CudaClusters::rebuild_worst(uint32_t clusters) {
  refit();
  const std::vector<uint32_t> worst = growth_.worst(clusters);
  if (worst.empty()) return;
  run([&](void* scratch, size_t& bytes) {
    umbel::cuda::rebuild_worst_frame_clusters(scratch, bytes, mesh(), config_, clusters, current_,
                                              areas_, other_, other_areas_, stream_);
  });
  std::swap(current_, other_);
  std::swap(areas_, other_areas_);
  std::erase_if(kept_,
                [&](uint32_t c) { return std::binary_search(worst.begin(), worst.end(), c); });
  hand_over();
  growth_.rebuilt(boxes(), kept_);
}

void CudaClusters::hand_over() {
  uint32_t count = 0;
  check_cuda(cudaMemcpyAsync(shared_triangles_.pointer, current_.indices, 12 * size_t{size_},
                             cudaMemcpyDeviceToDevice, stream_),
             "a copy");
  check_cuda(cudaMemcpyAsync(shared_items_.pointer, current_.items, 4 * size_t{size_},
                             cudaMemcpyDeviceToDevice, stream_),
             "a copy");
  if (!clustered_unseen_) {
    const cudaExternalSemaphoreSignalParams once{};
    check_cuda(cudaSignalExternalSemaphoresAsync(&has_clustered_.cuda, &once, 1, stream_),
               "signalling");
    clustered_unseen_ = true;
  }
  check_cuda(cudaMemcpyAsync(&count, current_.count, 4, cudaMemcpyDeviceToHost, stream_), "a copy");
  check_cuda(cudaStreamSynchronize(stream_), "clustering");
  offsets_host_.resize(size_t{count} + 1);
  boxes_host_.resize(count);
  check_cuda(cudaMemcpy(offsets_host_.data(), current_.offsets, 4 * offsets_host_.size(),
                        cudaMemcpyDeviceToHost),
             "a copy");
  check_cuda(cudaMemcpy(boxes_host_.data(), current_.boxes, sizeof(umbel::Aabb) * count,
                        cudaMemcpyDeviceToHost),
             "a copy");
  std::copy(offsets_host_.begin(), offsets_host_.end(), offsets_.mapped<uint32_t>().begin());
}

VkSemaphore CudaClusters::ready() {
  if (!clustered_unseen_) return VK_NULL_HANDLE;
  clustered_unseen_ = false;
  return has_clustered_.vulkan;
}

}  // namespace sample
