/// Writes every ray that an accelerator is asked about, and what it answers, to a file, so that the same rays can be
/// traced again, or answered again without tracing.
#pragma once

#include "../core/ray.h"

#include <fstream>
#include <mutex>
#include <string>

namespace mitsuba {

/// 48 bytes: origin, direction, maxt as floats, 1 (any hit) or 0 (closest) as a 32-bit integer; then t, u, v as floats
/// and the triangle as a 32-bit integer, `no_triangle` for a miss. Any hit is triangle 0 at t = 0.
struct RecordedRay {
    bsp::Vec3f o, d;
    float maxt;
    std::uint32_t any_hit;
    float t, u, v;
    std::uint32_t triangle;
};
static_assert(sizeof(RecordedRay) == 48);

/// A file of recorded rays, in the order of the answers.
class RayRecorder {
public:
    /// Throws std::runtime_error if the file cannot be opened. What it held is lost.
    explicit RayRecorder(const std::string &path) : m_file(path, std::ios::binary | std::ios::trunc) {
        if (!m_file)
            throw std::runtime_error("record: cannot write to the file \"" + path + "\"");
    }

    void write_closest(const bsp::Ray &ray, const bsp::Hit &hit) {
        write({ray.o, ray.d, ray.maxt, false, hit.t, hit.u, hit.v, hit.triangle});
    }

    void write_any(const bsp::Ray &ray, bool found) {
        write({ray.o, ray.d, ray.maxt, true, 0, 0, 0, found ? 0 : bsp::no_triangle});
    }

    void flush() {
        const std::lock_guard<std::mutex> lock(m_mutex);
        m_file.flush();
    }

private:
    /// Never throws: a full disk shows as a file that is too short.
    void write(const RecordedRay &entry) {
        const std::lock_guard<std::mutex> lock(m_mutex);
        m_file.write(reinterpret_cast<const char *>(&entry), sizeof entry);
    }

    std::mutex m_mutex;
    std::ofstream m_file;
};

} // namespace mitsuba
