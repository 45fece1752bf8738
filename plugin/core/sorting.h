/// Sorting of floats that a sweep needs: a radix sort where there are many, the standard library's where there are few.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

namespace bsp {

/// Ascending; no NaN. `scratch` is overwritten.
void sort_floats(std::vector<float> &values, std::vector<float> &scratch);

/// The float next to `value` (finite), towards larger ones if `up` and towards smaller ones if not.
inline float next_float(float value, bool up) {
    if (value == 0)
        return up ? 0x1p-149f : -0x1p-149f;
    std::int32_t bits;
    std::memcpy(&bits, &value, sizeof bits);
    bits += (value > 0) == up ? 1 : -1;
    std::memcpy(&value, &bits, sizeof bits);
    return value;
}

/// The largest float that is not above `value`.
inline float round_down(double value) {
    const float nearest = float(value);
    return double(nearest) > value ? next_float(nearest, false) : nearest;
}

/// The smallest float that is not below `value`.
inline float round_up(double value) {
    const float nearest = float(value);
    return double(nearest) < value ? next_float(nearest, true) : nearest;
}

} // namespace bsp
