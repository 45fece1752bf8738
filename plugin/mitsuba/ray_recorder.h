/// Writes every ray that an accelerator is asked about to a file, so that the same rays can be traced again.
#pragma once

#include "../core/ray.h"

#include <fstream>
#include <mutex>
#include <string>

namespace mitsuba {

/// 32 bytes a ray, in the order of the queries: origin, direction, maxt as floats, and 1 (any hit) or 0 (closest) as a
/// 32-bit integer.
class RayRecorder {
public:
    /// Throws std::runtime_error if the file cannot be opened. What it held is lost.
    explicit RayRecorder(const std::string &path) : m_file(path, std::ios::binary | std::ios::trunc) {
        if (!m_file)
            throw std::runtime_error("record: cannot write to the file \"" + path + "\"");
    }

    /// Never throws: a full disk shows as a file that is too short.
    void write(const bsp::Ray &ray, bool any_hit) {
        const Entry entry{ray.o, ray.d, ray.maxt, any_hit};
        const std::lock_guard<std::mutex> lock(m_mutex);
        m_file.write(reinterpret_cast<const char *>(&entry), sizeof entry);
    }

    void flush() {
        const std::lock_guard<std::mutex> lock(m_mutex);
        m_file.flush();
    }

private:
    struct Entry {
        bsp::Vec3f o, d;
        float maxt;
        std::uint32_t any_hit;
    };
    static_assert(sizeof(Entry) == 32);

    std::mutex m_mutex;
    std::ofstream m_file;
};

} // namespace mitsuba
