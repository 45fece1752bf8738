#include "scale.h"

#include <cmath>

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

} // namespace

// Users' numbers near 2^-100 and below may meet denormal ones.
Scale::Scale(int exponent)
    : m_factor(std::ldexp(1.0f, -exponent)), m_fastest(exponent < -100 ? -1 : fastest),
      m_end(largest_float * std::min(1.0f, m_factor)), m_inverse(std::ldexp(1.0, exponent)) {}

Scale Scale::for_largest(double size) {
    return Scale(std::clamp(exponent_of(size), -largest_exponent, largest_exponent));
}

ScaledRay Scale::apply_with_care(const Ray &ray) const noexcept {
    const StandardFloats floats;
    const ScaledRay miss{_mm_setzero_ps(), _mm_setr_ps(1, 0, 0, -1), 1};
    ScaledRay scaled{};
    float speed = 0;
    for (unsigned k = 0; k < 3; ++k) {
        scaled.o[k] = apply(ray.o[k]);
        if (!(std::abs(scaled.o[k]) <= farthest) || !std::isfinite(ray.d[k]))
            return miss;
        speed = std::max(speed, std::abs(ray.d[k]));
    }
    if (!(speed > 0 && ray.maxt >= 0))
        return miss;
    const double per_speed = speed >= slowest && speed <= fastest ? 1 : std::ldexp(1.0, -exponent_of(speed));
    for (unsigned k = 0; k < 3; ++k)
        scaled.d[k] = float(double(ray.d[k]) * per_speed);
    scaled.per_t = m_inverse * per_speed;
    const double end = std::min(double(ray.maxt), double(largest_float)) / scaled.per_t;
    scaled.d[3] = round_down(std::min(end, double(largest_float)));
    return scaled;
}

} // namespace bsp
