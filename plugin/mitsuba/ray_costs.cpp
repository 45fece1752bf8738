#include "ray_costs.h"

namespace mitsuba {

std::atomic<int> CostWatch::s_watches{0};

RayCosts &CostWatch::costs() {
    static thread_local RayCosts costs;
    return costs;
}

} // namespace mitsuba
