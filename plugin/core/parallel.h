/// Work on all cores, by the thread pool that Mitsuba itself uses (nanothread), so that a renderer's thread count is
/// ours. Tasks may be nested; exceptions reach the caller.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <exception>

#include <nanothread/nanothread.h>

#if defined(__SANITIZE_THREAD__)
#include <sanitizer/tsan_interface.h>
#endif

#include "standard_floats.h"

namespace bsp {

/// What was done before `give` is seen after `take` of the same address: the pool sees to it, and ThreadSanitizer,
/// which does not see into the pool, is told. Tasks take what is given at their start and give what is taken at their
/// end.
inline void give([[maybe_unused]] void *memory) {
#if defined(__SANITIZE_THREAD__)
    __tsan_release(memory);
#endif
}
inline void take([[maybe_unused]] void *memory) {
#if defined(__SANITIZE_THREAD__)
    __tsan_acquire(memory);
#endif
}

/// Another address for what comes back: at the same one, tasks would be seen to follow one another.
inline void *end_of(void *memory) { return static_cast<char *>(memory) + 1; }

/// Starts work(0) .. work(count-1), which live until they are waited for; `later`: even a single one on another thread,
/// if one is free.
template <typename Work> Task *start(std::uint32_t count, const Work &work, bool later) {
    struct Done {
        void *memory;
        ~Done() { give(end_of(memory)); }
    };
    void *memory = const_cast<Work *>(&work);
    give(memory);
    return task_submit(
        nullptr, count,
        [](std::uint32_t index, void *shared) {
            take(shared);
            const Done done{shared};
            const StandardFloats floats;
            (*static_cast<const Work *>(shared))(index);
        },
        memory, 0, nullptr, later);
}

/// Waits for what was started, and throws what it threw.
template <typename Work> void finish(Task *task, const Work &work) {
    struct Back {
        void *memory;
        ~Back() { take(end_of(memory)); }
    };
    const Back back{const_cast<Work *>(&work)};
    task_wait_and_release(task);
}

/// Calls `body(begin, end)` for ranges of at most `grain` indices that together are 0 .. count-1.
template <typename Body> void parallel_for(std::size_t count, std::size_t grain, const Body &body) {
    const auto range = [&](std::size_t index) { body(index * grain, std::min(count, (index + 1) * grain)); };
    finish(start(std::uint32_t((count + grain - 1) / grain), range, false), range);
}

/// Runs both, at the same time if a thread is free.
template <typename First, typename Second> void parallel_invoke(const First &first, const Second &second) {
    const auto only = [&](std::size_t) { second(); };
    Task *task = start(1, only, true);
    std::exception_ptr failure;
    try {
        first();
    } catch (...) {
        failure = std::current_exception();
    }
    try {
        finish(task, only);
    } catch (...) {
        if (!failure)
            failure = std::current_exception();
    }
    if (failure)
        std::rethrow_exception(failure);
}

} // namespace bsp
