/// Last-level cache misses of the calling thread, where Linux and the processor count them for ordinary users.
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
        m_file = int(syscall(SYS_perf_event_open, &attributes, 0, -1, -1, 0));
    }
    ~CacheMisses() {
        if (m_file >= 0)
            close(m_file);
    }
    CacheMisses(const CacheMisses &) = delete;
    CacheMisses &operator=(const CacheMisses &) = delete;

    std::optional<std::uint64_t> read() const {
        std::uint64_t count = 0;
        if (m_file < 0 || ::read(m_file, &count, sizeof count) != sizeof count)
            return {};
        return count;
    }

private:
    int m_file;
};

} // namespace bindings
