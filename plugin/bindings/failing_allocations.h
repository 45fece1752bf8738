/// Memory that runs out on purpose. A program or library that is linked with failing_allocations.cpp takes its memory
/// from here, its other libraries do not.
#pragma once

#include <cstdint>

namespace failing {

/// What goes wrong with the allocations that follow, on any thread; 0: nothing.
struct Plan {
    std::uint64_t fail_at = 0;      ///< this allocation, from 1, throws std::bad_alloc
    std::uint64_t interrupt_at = 0; ///< at this one SIGINT is raised
    std::uint64_t max_bytes = 0;    ///< those that would take more than this together throw std::bad_alloc
};

/// Carries out a plan while it lives. There may be one at a time.
class Scope {
public:
    explicit Scope(const Plan &plan);
    ~Scope();
    Scope(const Scope &) = delete;
    Scope &operator=(const Scope &) = delete;

    std::uint64_t allocations() const; ///< so far, those that failed too
    std::uint64_t peak_bytes() const;  ///< above what there was before
};

/// Bytes that are allocated now.
std::uint64_t live_bytes();

} // namespace failing
