// See plain_threads.h. oneTBB's own keeps its tables in memory of an allocator that the sanitizer
// does not see: memory that one thread gave back and another was given looked like a race of the
// two. And it finds a value by the thread's id, which a new thread may have of one that ended. Here
// a thread takes a place for as long as it lives, under a mutex, and values belong to places.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <type_traits>
#include <vector>

namespace tbb {

namespace plain_threads {

/// The least place that no other thread has.
class Place {
 public:
  Place() {
    const std::lock_guard lock(mutex());
    while (taken().count(number_)) ++number_;
    taken().insert(number_);
  }
  ~Place() {
    const std::lock_guard lock(mutex());
    taken().erase(number_);
  }
  Place(const Place&) = delete;
  Place& operator=(const Place&) = delete;

  static size_t mine() {
    static thread_local const Place place;
    return place.number_;
  }

 private:
  // Never destroyed: threads may end after what is static.
  static std::mutex& mutex() {
    static auto* const one = new std::mutex;
    return *one;
  }
  static std::set<size_t>& taken() {
    static auto* const one = new std::set<size_t>;
    return *one;
  }
  size_t number_ = 0;
};

}  // namespace plain_threads

template <typename Value>
class enumerable_thread_specific {
 public:
  class iterator {
   public:
    iterator(const std::vector<std::unique_ptr<Value>>& all, size_t at) : all_(&all), at_(at) {
      skip();
    }
    Value& operator*() const { return *(*all_)[at_]; }
    Value* operator->() const { return (*all_)[at_].get(); }
    iterator& operator++() {
      ++at_;
      skip();
      return *this;
    }
    bool operator==(const iterator& other) const { return at_ == other.at_; }

   private:
    void skip() {
      while (at_ < all_->size() && !(*all_)[at_]) ++at_;
    }
    const std::vector<std::unique_ptr<Value>>* all_;
    size_t at_;
  };

  enumerable_thread_specific() : make_([] { return std::make_unique<Value>(); }) {}
  template <typename Make>
    requires std::is_invocable_r_v<Value, Make>
  explicit enumerable_thread_specific(Make make)
      : make_([make] { return std::unique_ptr<Value>(new Value(make())); }) {}

  Value& local() {
    const size_t place = plain_threads::Place::mine();
    const std::lock_guard lock(mutex_);
    if (values_.size() <= place) values_.resize(place + 1);
    if (!values_[place]) values_[place] = make_();
    return *values_[place];
  }

  iterator begin() const { return {values_, 0}; }
  iterator end() const { return {values_, values_.size()}; }
  void clear() { values_.clear(); }

 private:
  std::function<std::unique_ptr<Value>()> make_;
  std::mutex mutex_;
  std::vector<std::unique_ptr<Value>> values_;
};

}  // namespace tbb
