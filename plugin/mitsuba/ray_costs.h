/// What the rays of a thread cost, in all accelerators of all plugins together, while someone wants to know. A library
/// of its own, which all plugins share.
#pragma once

#include <atomic>

#include "../core/ray.h"

namespace mitsuba {

/// What closest-hit and any-hit rays have cost so far; it only grows.
struct RayCosts {
    bsp::Counters closest, any;
};

/// While one of these lives, rays are counted on every thread.
class CostWatch {
public:
    CostWatch() { s_watches.fetch_add(1, std::memory_order_relaxed); }
    ~CostWatch() { s_watches.fetch_sub(1, std::memory_order_relaxed); }
    CostWatch(const CostWatch &) = delete;
    CostWatch &operator=(const CostWatch &) = delete;

    static bool is_on() { return s_watches.load(std::memory_order_relaxed) > 0; }
    /// Those of the calling thread.
    static RayCosts &costs();

private:
    static std::atomic<int> s_watches;
};

} // namespace mitsuba
