/// Memory for what every ray reads: large pages where the system gives them, so that addresses are found at once.
#pragma once

#include <cstddef>
#include <new>
#include <vector>

#include <sys/mman.h>

#include "ray.h"

namespace bsp {

template <typename T> struct LargePageAllocator {
    using value_type = T;

    LargePageAllocator() = default;
    template <typename U> LargePageAllocator(const LargePageAllocator<U> &) {}

    T *allocate(std::size_t count) {
        const std::size_t size = count * sizeof(T), unit = unit_of(count);
        void *const memory = ::operator new((size + unit - 1) / unit * unit, std::align_val_t(unit));
        if (unit == page)
            madvise(memory, size, MADV_HUGEPAGE); // a wish: small pages do as well
        return static_cast<T *>(memory);
    }
    void deallocate(T *memory, std::size_t count) { ::operator delete(memory, std::align_val_t(unit_of(count))); }

    bool operator==(const LargePageAllocator &) const { return true; }
    bool operator!=(const LargePageAllocator &) const { return false; }

private:
    static constexpr std::size_t page = std::size_t(1) << 21, line = 64;
    static std::size_t unit_of(std::size_t count) { return count * sizeof(T) < page ? line : page; }
};

template <typename T> using LargePageVector = std::vector<T, LargePageAllocator<T>>;

template <typename T> MemoryPart memory_of(const LargePageVector<T> &values) {
    return {values.data(), values.size() * sizeof(T)};
}

} // namespace bsp
