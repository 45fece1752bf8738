/// Answers rays from a recording instead of a tree, so that a frame can be timed in which traversal costs nothing.
#pragma once

#include <nanothread/nanothread.h>

#include <filesystem>
#include <vector>

#include "accelerator.h"
#include "ray_recorder.h"

namespace mitsuba {

/// Gives the answers of a recording in their order, whatever the rays, and after the last the first again. They are
/// right if one thread asks as one thread did when they were recorded: same scene, seed, samples per pixel and
/// resolution.
class RecordedAnswers final : public bsp::Accelerator {
public:
    /// `triangles` and `primitives` are how many there are to be hit. Throws std::runtime_error if there is more than
    /// one thread, or if the file is no recording of rays among so many triangles.
    RecordedAnswers(const std::string &path, std::size_t triangles, std::size_t primitives) {
        if (pool_size() > 1)
            throw std::runtime_error(
                "replay: answers are given in the order in which one thread asked, but there are " +
                std::to_string(pool_size()) + " threads: set the number of threads to 1");
        std::ifstream file(path, std::ios::binary);
        std::error_code error;
        const std::uintmax_t size = std::filesystem::file_size(path, error);
        if (!file || error)
            throw std::runtime_error("replay: cannot read the file \"" + path + "\"");
        if (size == 0 || size % sizeof(RecordedRay) != 0)
            throw std::runtime_error("replay: the file \"" + path + "\" has " + std::to_string(size) +
                                     " bytes, but a recording has " + std::to_string(sizeof(RecordedRay)) +
                                     " for each of its rays, and at least one ray");
        m_answers.reserve(size / sizeof(RecordedRay));
        for (RecordedRay entry; file.read(reinterpret_cast<char *>(&entry), sizeof entry);) {
            const bool known = bsp::is_primitive(entry.triangle) ? bsp::primitive_index(entry.triangle) < primitives
                                                                 : entry.triangle < triangles;
            if (entry.triangle != bsp::no_triangle && !known)
                throw std::runtime_error("replay: a ray in the file \"" + path + "\" hit triangle " +
                                         std::to_string(entry.triangle) + ", but here are only " +
                                         std::to_string(triangles) + ": it was recorded with another scene");
            m_answers.push_back({entry.t, entry.u, entry.v, entry.triangle});
        }
        if (m_answers.size() != size / sizeof(RecordedRay))
            throw std::runtime_error("replay: cannot read all of the file \"" + path + "\"");
        m_statistics.spec = "free";
        m_statistics.triangles = triangles;
        m_statistics.primitives = primitives;
    }

    bsp::Hit closest(const bsp::Ray &) const noexcept override { return next(); }
    bool any(const bsp::Ray &) const noexcept override { return next().triangle != bsp::no_triangle; }

    bsp::Hit count_closest(const bsp::Ray &ray, bsp::Counters &counters) const noexcept override {
        ++counters.rays;
        return closest(ray);
    }
    bool count_any(const bsp::Ray &ray, bsp::Counters &counters) const noexcept override {
        ++counters.rays;
        return any(ray);
    }

    std::vector<bsp::Plane> planes() const override { return {}; }
    std::vector<bsp::MemoryPart> memory() const override { return {}; }

private:
    const bsp::Hit &next() const noexcept {
        const std::size_t place = m_next;
        m_next = place + 1 == m_answers.size() ? 0 : place + 1;
        return m_answers[place];
    }

    std::vector<bsp::Hit> m_answers;
    mutable std::size_t m_next = 0;
};

} // namespace mitsuba
