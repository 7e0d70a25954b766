// Memory of a factor: large, written before it is read, and quick to release.
#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <cstdlib>
#include <memory>
#include <new>
#include <type_traits>

#include "model/tuning.h"

namespace marble {

/// Like new T[size]. From 32 MiB on the array has its own mapping, with huge pages if the system has them.
/// With small pages it takes 50 ms and more to release a gigabyte, too long for a worker that must be free at
/// once.
template <class T>
class LargeArray {
  static_assert(std::is_trivial_v<T>);

 public:
  LargeArray() = default;
  explicit LargeArray(std::size_t size) {
    const std::size_t bytes = size * sizeof(T);
    if (static_cast<double>(bytes) < tuning::large_bytes) {
      data_ = {new T[size], Release{0}};
      return;
    }
    void* const mapped = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (mapped == MAP_FAILED) throw std::bad_alloc();
    static_cast<void>(madvise(mapped, bytes, MADV_HUGEPAGE));
    data_ = {static_cast<T*>(mapped), Release{bytes}};
  }

  [[nodiscard]] T* data() const { return data_.get(); }
  T& operator[](std::ptrdiff_t i) const { return data_.get()[i]; }

 private:
  struct Release {
    std::size_t mapped = 0;
    void operator()(T* data) const {
      if (mapped > 0) {
        munmap(data, mapped);
      } else {
        delete[] data;
      }
    }
  };
  std::unique_ptr<T[], Release> data_;
};

}  // namespace marble
