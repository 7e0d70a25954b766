// The queue as a pure data structure: bounded in jobs, first in, first out. No threads, no clock.
#pragma once

#include <algorithm>
#include <deque>
#include <memory>
#include <optional>

namespace marble::server {

template <class Item>
class JobQueue {
 public:
  explicit JobQueue(std::size_t capacity) : capacity_(capacity) {}

  /// Place in the queue (0 is next), or nothing if the queue is full; then the caller keeps the item.
  [[nodiscard]] std::optional<std::size_t> push(std::shared_ptr<Item> item) {
    if (full()) return std::nullopt;
    items_.push_back(std::move(item));
    return items_.size() - 1;
  }
  /// The next item, or null if there is none.
  [[nodiscard]] std::shared_ptr<Item> pop() {
    if (items_.empty()) return nullptr;
    std::shared_ptr<Item> item = std::move(items_.front());
    items_.pop_front();
    return item;
  }
  /// True if the item was waiting; it is no more.
  bool remove(const Item* item) {
    const auto found =
        std::find_if(items_.begin(), items_.end(), [item](const auto& i) { return i.get() == item; });
    if (found == items_.end()) return false;
    items_.erase(found);
    return true;
  }
  [[nodiscard]] bool full() const { return items_.size() >= capacity_; }
  [[nodiscard]] std::size_t size() const { return items_.size(); }

 private:
  std::size_t capacity_;
  std::deque<std::shared_ptr<Item>> items_;
};

}  // namespace marble::server
