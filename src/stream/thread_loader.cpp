// Loads pages on a pool of threads: a queue of requests, first come first served, and a list of
// arrivals.
#include <algorithm>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <new>
#include <string>
#include <thread>
#include <utility>

#include "umbel/stream.hpp"

namespace umbel {
namespace {

class ThreadLoader : public PageLoader {
 public:
  ThreadLoader(const Asset& asset, uint32_t threads) : asset_(asset) {
    try {
      threads_.reserve(threads);
      while (threads_.size() < threads) threads_.emplace_back([this] { work(); });
    } catch (...) {
      end();
      throw;
    }
  }

  ~ThreadLoader() override { end(); }

  void request(uint32_t page) override {
    {
      const std::lock_guard lock(mutex_);
      // Each page that is asked for has its place among the arrivals, so that threads need none.
      const size_t places = arrived_.size() + queue_.size() + loading_ + 1;
      if (arrived_.capacity() < places) arrived_.reserve(2 * places);
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
    std::vector<PageArrival> arrived;
    const std::lock_guard lock(mutex_);
    arrived.reserve(queue_.size() + loading_);
    arrived_.swap(arrived);
    return arrived;
  }

 private:
  void end() {
    {
      const std::lock_guard lock(mutex_);
      ends_ = true;
    }
    wake_.notify_all();
    for (std::thread& thread : threads_) thread.join();
  }

  void work() {
    std::unique_lock lock(mutex_);
    while (true) {
      wake_.wait(lock, [&] { return ends_ || !queue_.empty(); });
      if (ends_) return;
      const uint32_t page = queue_.front();
      queue_.pop_front();
      ++loading_;
      lock.unlock();
      PageArrival arrival = load(page);
      lock.lock();
      --loading_;
      arrived_.push_back(std::move(arrival));
    }
  }

  PageArrival load(uint32_t page) const {
    PageArrival arrival;
    arrival.page = page;
    try {
      arrival.data = std::make_shared<const AssetPage>(asset_.read_page(page));
    } catch (const std::bad_alloc&) {
      arrival.problem = "no memory";  // short enough to need none
    } catch (const std::exception& error) {
      arrival.problem = text_of(error);
    } catch (...) {
      arrival.problem = "unknown error";
    }
    return arrival;
  }

  static std::string text_of(const std::exception& error) {
    try {
      return error.what();
    } catch (const std::bad_alloc&) {
      return "no memory";
    }
  }

  const Asset& asset_;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<uint32_t> queue_;
  std::vector<PageArrival> arrived_;
  size_t loading_ = 0;  // pages that threads are reading
  bool ends_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace

std::unique_ptr<PageLoader> make_thread_loader(const Asset& asset, uint32_t threads) {
  return std::make_unique<ThreadLoader>(asset, std::max(threads, 1u));
}

}  // namespace umbel
