/// Counts the different planes that a builder looks at, per depth. Filled from many threads.
#pragma once

#include <algorithm>
#include <array>
#include <cstring>
#include <mutex>
#include <vector>

#include "builder.h"
#include "direction.h"
#include "random.h"

namespace bsp {

class PlaneSurvey {
public:
    void add(int depth, const Direction &direction, const std::vector<float> &offsets) {
        std::vector<std::uint64_t> keys;
        keys.reserve(offsets.size());
        for (const float offset : offsets)
            keys.push_back(key(direction, offset));
        m_levels[std::size_t(depth)].add(keys);
    }

    std::vector<LevelPlanes> counts() {
        std::vector<LevelPlanes> result;
        Level all;
        for (Level &level : m_levels) {
            if (level.considered == 0)
                continue;
            level.unite();
            result.push_back({level.considered, level.keys.size()});
            all.add(level.keys);
            all.considered += level.considered - level.keys.size();
        }
        all.unite();
        result.push_back({all.considered, all.keys.size()});
        return result;
    }

private:
    /// Hashes of planes: two of them are as good as never equal by accident (2^-64 a pair).
    static std::uint64_t key(const Direction &direction, float offset) {
        const float values[3] = {direction.a, direction.b, offset + 0.0f};
        std::uint64_t hash = direction.major;
        for (const float value : values) {
            std::uint32_t bits;
            std::memcpy(&bits, &value, sizeof bits);
            hash = Random(hash ^ bits).next();
        }
        return hash;
    }

    struct Level {
        std::mutex mutex;
        std::vector<std::uint64_t> keys; ///< united ones first
        std::size_t united = 0, considered = 0;

        void add(const std::vector<std::uint64_t> &more) {
            const std::lock_guard<std::mutex> lock(mutex);
            considered += more.size();
            keys.insert(keys.end(), more.begin(), more.end());
            if (keys.size() > 2 * united + 1000000)
                unite();
        }

        void unite() {
            std::sort(keys.begin(), keys.end());
            keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
            united = keys.size();
        }
    };

    std::array<Level, depth_limit + 1> m_levels;
};

} // namespace bsp
