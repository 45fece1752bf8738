/// Work on all cores, by the thread pool that Mitsuba itself uses (nanothread), so that a renderer's thread count is
/// ours. Tasks may be nested; exceptions reach the caller.
#pragma once

#include <cstddef>
#include <cstdint>
#include <exception>

#include <nanothread/nanothread.h>

#include "standard_floats.h"

namespace bsp {

/// Calls `body(begin, end)` for ranges of at most `grain` indices that together are 0 .. count-1.
template <typename Body> void parallel_for(std::size_t count, std::size_t grain, const Body &body) {
    drjit::parallel_for(drjit::blocked_range<std::size_t>(0, count, grain), [&](const auto &range) {
        const StandardFloats floats;
        body(std::size_t(range.begin()), std::size_t(range.end()));
    });
}

/// Runs both, at the same time if a thread is free.
template <typename First, typename Second> void parallel_invoke(const First &first, const Second &second) {
    Task *task = drjit::do_async([&second] {
        const StandardFloats floats;
        second();
    });
    std::exception_ptr failure;
    try {
        first();
    } catch (...) {
        failure = std::current_exception();
    }
    try {
        task_wait_and_release(task);
    } catch (...) {
        if (!failure)
            failure = std::current_exception();
    }
    if (failure)
        std::rethrow_exception(failure);
}

} // namespace bsp
