/// Cache misses of the calling thread, where Linux and the processor count them for ordinary users: of the last level
/// on Intel, of the second on AMD.
#pragma once

#include <cstdint>
#include <optional>

#include <linux/perf_event.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace bindings {

/// Counts from its construction on.
class CacheMisses {
public:
    CacheMisses() {
        perf_event_attr attributes{};
        attributes.size = sizeof attributes;
        attributes.type = PERF_TYPE_HARDWARE;
        attributes.config = PERF_COUNT_HW_CACHE_MISSES;
        attributes.exclude_kernel = attributes.exclude_hv = 1;
        attributes.read_format = PERF_FORMAT_TOTAL_TIME_ENABLED | PERF_FORMAT_TOTAL_TIME_RUNNING;
        m_file = int(syscall(SYS_perf_event_open, &attributes, 0, -1, -1, 0));
    }
    ~CacheMisses() {
        if (m_file >= 0)
            close(m_file);
    }
    CacheMisses(const CacheMisses &) = delete;
    CacheMisses &operator=(const CacheMisses &) = delete;

    /// Misses since `before`, of all that time, also where several events took turns on the counter.
    struct Reading {
        std::uint64_t count = 0, enabled = 0, running = 0;

        std::optional<std::uint64_t> since(const Reading &before) const {
            const double part = double(running - before.running);
            if (!(part > 0))
                return {};
            return std::uint64_t(double(count - before.count) * (double(enabled - before.enabled) / part));
        }
    };

    std::optional<Reading> read() const {
        Reading found;
        if (m_file < 0 || ::read(m_file, &found, sizeof found) != sizeof found)
            return {};
        return found;
    }

private:
    int m_file;
};

} // namespace bindings
