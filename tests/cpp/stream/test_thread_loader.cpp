// Pages that are loaded on threads: what is asked for comes in its order, unless it is cancelled.
#include <gtest/gtest.h>

#include <condition_variable>
#include <memory>
#include <mutex>
#include <span>
#include <thread>
#include <utility>
#include <vector>

#include "stream/world.hpp"
#include "umbel/asset.hpp"
#include "umbel/stream.hpp"

namespace umbel {
namespace {

using testing::world;

/// A file whose readers wait while it is closed.
class GatedFile : public ByteSource {
 public:
  explicit GatedFile(std::shared_ptr<const ByteSource> file) : file_(std::move(file)) {}
  uint64_t size() const override { return file_->size(); }
  void read(uint64_t offset, std::span<std::byte> out) const override {
    {
      std::unique_lock lock(mutex_);
      ++waiting_;
      changed_.notify_all();
      changed_.wait(lock, [&] { return is_open_; });
      --waiting_;
    }
    file_->read(offset, out);
  }

  void set_open(bool open) {
    const std::lock_guard lock(mutex_);
    is_open_ = open;
    changed_.notify_all();
  }
  void wait_for_a_reader() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return waiting_ > 0; });
  }

 private:
  std::shared_ptr<const ByteSource> file_;
  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
  mutable int waiting_ = 0;
  bool is_open_ = true;
};

TEST(ThreadLoader, cancels_what_no_thread_reads_yet) {
  const auto file = std::make_shared<GatedFile>(open_file(world().path()));
  const Asset asset(file);
  ASSERT_GT(asset.info().pages, 4u);
  const auto loader = make_thread_loader(asset, 1);
  file->set_open(false);
  loader->request(1);
  file->wait_for_a_reader();
  for (const uint32_t page : {2, 3, 4}) loader->request(page);
  EXPECT_TRUE(loader->cancel(3));
  EXPECT_FALSE(loader->cancel(3));
  EXPECT_FALSE(loader->cancel(1));  // being read
  EXPECT_FALSE(loader->cancel(0));  // never asked for
  EXPECT_TRUE(loader->poll().empty());
  file->set_open(true);
  std::vector<uint32_t> pages;
  while (pages.size() < 3) {
    for (const PageArrival& arrival : loader->poll()) {
      pages.push_back(arrival.page);
      ASSERT_NE(arrival.data, nullptr) << arrival.problem;
      EXPECT_EQ(arrival.data->bytes, asset.read_page(arrival.page).bytes);
    }
    std::this_thread::yield();
  }
  EXPECT_EQ(pages, (std::vector<uint32_t>{1, 2, 4}));
}

}  // namespace
}  // namespace umbel
