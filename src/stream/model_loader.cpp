// A simulated network link with a latency and a bandwidth: requests overlap, bytes are sent one
// after the other, and a hash of page and attempt decides which loads fail, arrive short or
// corrupt, or are slow.
#include <algorithm>
#include <map>

#include "base/hash.hpp"
#include "umbel/stream.hpp"

namespace umbel {
namespace {

struct Transfer {
  uint32_t page;
  double ready;
  bool fails;
  uint32_t failure;  ///< 0: nothing arrives, 1: half of it, 2: a wrong byte
};

class ModelLoader : public PageLoader {
 public:
  ModelLoader(const Asset& asset, const LinkModel& link, std::shared_ptr<const double> clock)
      : asset_(asset), link_(link), clock_(std::move(clock)), attempts_(asset.info().pages) {
    for (uint32_t p = 0; p < asset.info().pages; ++p)
      pages_.push_back(std::make_shared<const AssetPage>(asset.read_page(p)));
  }

  void request(uint32_t page) override {
    const bool is_slow = chance(page, 1) < link_.slow_rate;
    const bool fails = chance(page, 2) < link_.failure_rate;
    const double times = is_slow ? 10 : 1;
    const double begins = std::max(free_, *clock_ + times * link_.latency_seconds);
    const double takes =
        times * static_cast<double>(pages_[page]->bytes.size()) / link_.bytes_per_second;
    free_ = std::max(free_, *clock_) + (is_slow ? 0 : takes);
    under_way_.push_back({page, begins + takes, fails, static_cast<uint32_t>(3 * chance(page, 3))});
    ++attempts_[page];
  }

  bool cancel(uint32_t page) override {
    return std::erase_if(under_way_, [&](const Transfer& t) {
             return t.page == page && t.ready > *clock_;
           }) > 0;
  }

  std::vector<PageArrival> poll() override {
    std::vector<PageArrival> arrivals;
    for (const Transfer& t : under_way_) {
      if (t.ready > *clock_) continue;
      if (t.fails)
        arrivals.push_back(broken(t));
      else
        arrivals.push_back({t.page, pages_[t.page], {}});
    }
    std::erase_if(under_way_, [&](const Transfer& t) { return t.ready <= *clock_; });
    return arrivals;
  }

 private:
  /// In [0, 1), for the page's next attempt.
  double chance(uint32_t page, uint32_t salt) const {
    const uint64_t key[] = {uint64_t{attempts_[page]} << 32 | page,
                            uint64_t{salt} << 32 | link_.seed};
    return static_cast<double>(xxh64(key, sizeof key) >> 11) * 0x1p-53;
  }

  /// The arrival of a load that fails: see Transfer::failure.
  PageArrival broken(const Transfer& t) const {
    std::vector<std::byte> bytes = pages_[t.page]->bytes;
    if (t.failure == 1) bytes.resize(bytes.size() / 2);
    if (t.failure == 2) bytes[bytes.size() / 3] ^= std::byte{1};
    try {
      if (t.failure == 0) throw Error(ErrorCode::kIo, "the link failed");
      asset_.page_of(t.page, std::move(bytes));
    } catch (const Error& error) {
      return {t.page, nullptr, error.what()};
    }
    return {t.page, pages_[t.page], {}};
  }

  const Asset& asset_;
  LinkModel link_;
  std::shared_ptr<const double> clock_;
  std::vector<std::shared_ptr<const AssetPage>> pages_;
  std::vector<uint32_t> attempts_;
  std::vector<Transfer> under_way_;
  double free_ = 0;  // when all requested bytes have been sent
};

}  // namespace

std::unique_ptr<PageLoader> make_model_loader(const Asset& asset, const LinkModel& link,
                                              std::shared_ptr<const double> clock) {
  const auto is_share = [](double rate) { return rate >= 0 && rate <= 1; };
  if (!(link.latency_seconds >= 0) || !(link.bytes_per_second > 0) || !clock)
    throw Error(ErrorCode::kInvalidArgument,
                "a link needs a latency that is not negative, a bandwidth and a clock");
  if (!is_share(link.failure_rate) || !is_share(link.slow_rate))
    throw Error(ErrorCode::kInvalidArgument,
                "the shares of a link's loads that fail and that are slow must be from 0 to 1");
  return std::make_unique<ModelLoader>(asset, link, std::move(clock));
}

}  // namespace umbel
