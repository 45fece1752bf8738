/// Times a stream of rays on the calling thread.
#pragma once

#include <nanobind/nanobind.h>

#include <chrono>
#include <ctime>

#include <pmmintrin.h>

#include "cache_misses.h"
#include "ray_arrays.h"

namespace bindings {

/// Denormals are flushed to zero while it lives, as in the threads that Mitsuba renders with.
class RenderFloats {
public:
    RenderFloats() : m_saved(_mm_getcsr()) {
        _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON);
        _MM_SET_DENORMALS_ZERO_MODE(_MM_DENORMALS_ZERO_ON);
    }
    ~RenderFloats() { _mm_setcsr(m_saved); }
    RenderFloats(const RenderFloats &) = delete;
    RenderFloats &operator=(const RenderFloats &) = delete;

private:
    unsigned m_saved;
};

/// Processor time of this thread: other processes on a busy machine do not enter it.
inline double thread_seconds() {
    timespec time{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return double(time.tv_sec) + 1e-9 * double(time.tv_nsec);
}

/// (processor seconds, seconds on the clock, cache misses or None) of `trace(ray)`, a float, for all rays in
/// order.
template <typename Trace> nb::tuple replay(const RayArrays &rays, const Trace &trace) {
    double busy_s = 0;
    std::chrono::duration<double> elapsed{};
    std::optional<std::uint64_t> misses;
    {
        nb::gil_scoped_release release;
        const RenderFloats floats;
        const CacheMisses counted;
        float sum = 0;
        const auto before = counted.read();
        const double busy_before = thread_seconds();
        const auto start = std::chrono::steady_clock::now();
        for (std::size_t i = 0; i < rays.size(); ++i)
            sum += trace(rays[i]);
        elapsed = std::chrono::steady_clock::now() - start;
        busy_s = thread_seconds() - busy_before;
        if (const auto after = counted.read(); before && after)
            misses = after->since(*before);
        [[maybe_unused]] volatile float used = sum; // or the compiler could leave the work out
    }
    nb::object counted = misses ? nb::object(nb::int_(*misses)) : nb::object(nb::none());
    return nb::make_tuple(busy_s, elapsed.count(), counted);
}

} // namespace bindings
