// Loads pages on a pool of threads: a queue of requests, first come first served, and a list of
// arrivals.
#include <algorithm>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>
#include <utility>

#include "umbel/stream.hpp"

namespace umbel {
namespace {

class ThreadLoader : public PageLoader {
 public:
  ThreadLoader(const Asset& asset, uint32_t threads) : asset_(asset) {
    for (uint32_t i = 0; i < threads; ++i) threads_.emplace_back([this] { work(); });
  }

  ~ThreadLoader() override {
    {
      const std::lock_guard lock(mutex_);
      ends_ = true;
    }
    wake_.notify_all();
    for (std::thread& thread : threads_) thread.join();
  }

  void request(uint32_t page) override {
    {
      const std::lock_guard lock(mutex_);
      queue_.push_back(page);
    }
    wake_.notify_one();
  }

  bool cancel(uint32_t page) override {
    const std::lock_guard lock(mutex_);
    const auto at = std::find(queue_.begin(), queue_.end(), page);
    if (at == queue_.end()) return false;
    queue_.erase(at);
    return true;
  }

  std::vector<PageArrival> poll() override {
    const std::lock_guard lock(mutex_);
    return std::exchange(arrived_, {});
  }

 private:
  void work() {
    std::unique_lock lock(mutex_);
    while (true) {
      wake_.wait(lock, [&] { return ends_ || !queue_.empty(); });
      if (ends_) return;
      const uint32_t page = queue_.front();
      queue_.pop_front();
      lock.unlock();
      PageArrival arrival = load(page);
      lock.lock();
      arrived_.push_back(std::move(arrival));
    }
  }

  PageArrival load(uint32_t page) const {
    PageArrival arrival;
    arrival.page = page;
    try {
      arrival.data = std::make_shared<const AssetPage>(asset_.read_page(page));
    } catch (const std::exception& error) {
      arrival.problem = error.what();
    } catch (...) {
      arrival.problem = "reading page " + std::to_string(page) + " failed";
    }
    return arrival;
  }

  const Asset& asset_;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<uint32_t> queue_;
  std::vector<PageArrival> arrived_;
  bool ends_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace

std::unique_ptr<PageLoader> make_thread_loader(const Asset& asset, uint32_t threads) {
  return std::make_unique<ThreadLoader>(asset, std::max(threads, 1u));
}

}  // namespace umbel
