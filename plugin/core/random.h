/// Random numbers that depend on a seed and nothing else: SplitMix64 (Steele, Lea, Flood 2014). The standard library's
/// distributions differ between implementations, and a tree must not.
#pragma once

#include <cstdint>

namespace bsp {

class Random {
public:
    explicit Random(std::uint64_t seed) : m_state(seed) {}

    std::uint64_t next() {
        std::uint64_t z = (m_state += 0x9e3779b97f4a7c15u);
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
        return z ^ (z >> 31);
    }

    /// Uniform in [0, 1).
    double uniform() { return double(next() >> 11) * 0x1p-53; }

    /// Uniform in 0 .. count-1; `count` below 2^32.
    std::uint32_t below(std::uint32_t count) { return std::uint32_t(((next() >> 32) * count) >> 32); }

private:
    std::uint64_t m_state;
};

/// The seed of a node's child, from the seed of the node: the same whatever thread builds it, and in whatever order.
inline std::uint64_t child_seed(std::uint64_t seed, bool above) { return Random(2 * seed + (above ? 1 : 0)).next(); }

} // namespace bsp
