/// Counters that many rendering threads add to, and their JSON.
#pragma once

#include <atomic>
#include <ostream>

#include "ray_costs.h"

namespace mitsuba {

struct SharedCounters {
    std::atomic<uint64_t> rays{0}, axis_steps{0}, oblique_steps{0}, leaves{0}, triangle_tests{0};

    SharedCounters &operator+=(const bsp::Counters &counters) {
        rays += counters.rays;
        axis_steps += counters.axis_steps;
        oblique_steps += counters.oblique_steps;
        leaves += counters.leaves;
        triangle_tests += counters.triangle_tests;
        return *this;
    }
};

inline std::ostream &operator<<(std::ostream &os, const SharedCounters &c) {
    return os << "{\"rays\": " << c.rays << ", \"axis_steps\": " << c.axis_steps
              << ", \"oblique_steps\": " << c.oblique_steps << ", \"leaves_visited\": " << c.leaves
              << ", \"triangle_tests\": " << c.triangle_tests << "}";
}

/// The counters of closest-hit and of any-hit rays.
struct RayCounters {
    SharedCounters closest, any;

    /// Also to those of the thread.
    template <bool any_hit> void add(const bsp::Counters &counters) {
        RayCosts &costs = CostWatch::costs();
        (any_hit ? any : closest) += counters;
        (any_hit ? costs.any : costs.closest) += counters;
    }
};

inline std::ostream &operator<<(std::ostream &os, const RayCounters &c) {
    return os << "{\"closest\": " << c.closest << ", \"any\": " << c.any << "}";
}

} // namespace mitsuba
