/// A fast 64-bit hash of memory, to name content and to find damage. It is no defence against a forger.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "random.h"

namespace bsp {

/// SplitMix64's step over every word, in four lanes so that a processor works on four words at once. Each step is a
/// bijection, so damage to a single word always changes the result.
class Hash {
public:
    void add(const void *data, std::size_t bytes) {
        const char *at = static_cast<const char *>(data);
        std::size_t left = bytes;
        for (; left >= stripe; at += stripe, left -= stripe)
            mix(at);
        char rest[stripe] = {};
        if (left > 0)
            std::memcpy(rest, at, left);
        mix(rest);
        m_lanes[0] = Random(m_lanes[0] ^ bytes).next(); // the zeros at the end are not content
    }

    std::uint64_t value() const {
        std::uint64_t value = 0;
        for (const std::uint64_t lane : m_lanes)
            value = Random(value ^ lane).next();
        return value;
    }

private:
    static constexpr std::size_t lanes = 4, stripe = lanes * sizeof(std::uint64_t);

    void mix(const char *at) {
        for (std::size_t i = 0; i < lanes; ++i) {
            std::uint64_t word;
            std::memcpy(&word, at + i * sizeof word, sizeof word);
            m_lanes[i] = Random(m_lanes[i] ^ word).next();
        }
    }

    std::uint64_t m_lanes[lanes] = {1, 2, 3, 4};
};

} // namespace bsp
