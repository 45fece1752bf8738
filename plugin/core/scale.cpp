#include "scale.h"

#include <cmath>
#include <cstdint>
#include <cstring>

#include "sorting.h"
#include "standard_floats.h"

namespace bsp {
namespace {

constexpr int largest_exponent = 126; ///< 2^126 and its inverse are normal floats
constexpr float largest_float = std::numeric_limits<float>::max();

/// The exponent e for which x 2^-e is in [1/2, 1); 0 for 0.
int exponent_of(double x) {
    int exponent = 0;
    std::frexp(x, &exponent);
    return exponent;
}

/// The power of two that brings a number above 0 into [1/2, 1), from the bits of its exponent: as double, no float is
/// denormal.
double power_that_normalizes(float x) {
    double number = x;
    std::uint64_t bits;
    std::memcpy(&bits, &number, sizeof bits);
    bits = (2045 - (bits >> 52)) << 52;
    std::memcpy(&number, &bits, sizeof bits);
    return number;
}

} // namespace

// Users' numbers near 2^-100 and below may meet denormal ones.
Scale::Scale(int exponent)
    : m_factor(std::ldexp(1.0f, -exponent)), m_fastest(exponent < -100 ? -1 : fastest),
      m_end(largest_float * std::min(1.0f, m_factor)), m_inverse(std::ldexp(1.0, exponent)) {}

Scale Scale::for_largest(double size) {
    return Scale(std::clamp(exponent_of(size), -largest_exponent, largest_exponent));
}

// Number by number in registers: vectors that are filled in memory would have to wait for it.
ScaledRay Scale::apply_with_care(const Ray &ray) const noexcept {
    const StandardFloats floats;
    const ScaledRay miss{_mm_setzero_ps(), _mm_setr_ps(1, 0, 0, -1), 1};
    const float x = apply(ray.o.x), y = apply(ray.o.y), z = apply(ray.o.z);
    const auto near = [](float coordinate) { return std::abs(coordinate) <= farthest; };
    if (!near(x) || !near(y) || !near(z))
        return miss;
    if (!std::isfinite(ray.d.x) || !std::isfinite(ray.d.y) || !std::isfinite(ray.d.z))
        return miss;
    const float speed = std::max({std::abs(ray.d.x), std::abs(ray.d.y), std::abs(ray.d.z)});
    if (!(speed > 0 && ray.maxt >= 0))
        return miss;
    const double per_speed = speed >= slowest && speed <= fastest ? 1 : power_that_normalizes(speed);
    const auto slowed = [&](float component) { return float(double(component) * per_speed); };
    const double per_t = m_inverse * per_speed;
    const double end = std::min(double(ray.maxt), double(largest_float)) / per_t;
    const float maxt = round_down(std::min(end, double(largest_float)));
    return {_mm_setr_ps(x, y, z, z), _mm_setr_ps(slowed(ray.d.x), slowed(ray.d.y), slowed(ray.d.z), maxt), per_t};
}

} // namespace bsp
