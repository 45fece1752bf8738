#include "failing_allocations.h"

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdlib>
#include <new>

#include <malloc.h>

namespace failing {
namespace {

struct State {
    std::atomic<bool> active{false};
    Plan plan;
    std::uint64_t base = 0; ///< bytes there were when the plan began
    std::atomic<std::uint64_t> allocations{0}, live{0}, peak{0};
};
State state;

/// Throws if the plan says so. `bytes` are asked for.
void follow_plan(std::size_t bytes) {
    if (!state.active.load(std::memory_order_acquire))
        return;
    const Plan &plan = state.plan;
    const std::uint64_t number = ++state.allocations;
    if (number == plan.interrupt_at)
        std::raise(SIGINT);
    const bool too_much = plan.max_bytes > 0 && state.live + bytes > state.base + plan.max_bytes;
    if (number == plan.fail_at || too_much)
        throw std::bad_alloc();
}

void *taken(void *memory) {
    if (!memory)
        throw std::bad_alloc();
    const std::uint64_t live = state.live += malloc_usable_size(memory);
    for (std::uint64_t peak = state.peak; live > peak && !state.peak.compare_exchange_weak(peak, live);)
        ;
    return memory;
}

void release(void *memory) {
    state.live -= malloc_usable_size(memory); // 0 for the null pointer
    std::free(memory);
}

} // namespace

Scope::Scope(const Plan &plan) {
    state.plan = plan;
    state.base = state.live;
    state.peak = state.base;
    state.allocations = 0;
    state.active.store(true, std::memory_order_release);
}

Scope::~Scope() { state.active = false; }

std::uint64_t Scope::allocations() const { return state.allocations; }
std::uint64_t Scope::peak_bytes() const { return state.peak - state.base; }
std::uint64_t live_bytes() { return state.live; }

} // namespace failing

// The forms of `new` and `delete` that all others end in.
void *operator new(std::size_t size) {
    failing::follow_plan(size);
    return failing::taken(std::malloc(std::max<std::size_t>(1, size)));
}
void *operator new(std::size_t size, std::align_val_t alignment) {
    failing::follow_plan(size);
    const std::size_t unit = std::size_t(alignment);
    return failing::taken(std::aligned_alloc(unit, (std::max<std::size_t>(1, size) + unit - 1) / unit * unit));
}
void operator delete(void *memory) noexcept { failing::release(memory); }
void operator delete(void *memory, std::size_t) noexcept { failing::release(memory); }
void operator delete(void *memory, std::align_val_t) noexcept { failing::release(memory); }
void operator delete(void *memory, std::size_t, std::align_val_t) noexcept { failing::release(memory); }
