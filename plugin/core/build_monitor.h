/// How another thread watches and ends the building of a tree.
#pragma once

#include <atomic>
#include <cstdint>
#include <exception>

namespace bsp {

/// Owns no memory, so that a build can be ended even when there is none left.
struct BuildCancelled : std::exception {
    const char *what() const noexcept override { return "building the tree was interrupted"; }
};

class BuildMonitor {
public:
    /// Ends the build soon, on all threads; it then throws BuildCancelled.
    void cancel() { m_cancelled = true; }
    void check() const {
        if (m_cancelled.load(std::memory_order_relaxed))
            throw BuildCancelled();
    }

    /// The part of the work that is done, 0 to 1: that of the triangles whose leaves are made.
    double progress() const { return double(m_finished.load(std::memory_order_relaxed)) / unit; }
    void finish(double share) { m_finished.fetch_add(std::uint64_t(share * unit), std::memory_order_relaxed); }

private:
    static constexpr double unit = 0x1p60;
    std::atomic<bool> m_cancelled{false};
    std::atomic<std::uint64_t> m_finished{0};
};

} // namespace bsp
