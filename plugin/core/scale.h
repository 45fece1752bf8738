/// The units of an accelerator: the user's, times a power of two that brings the largest coordinate near 1, so that
/// scenes of any size are alike. Scaling by a power of two changes no digit of a number.
#pragma once

#include <immintrin.h>

#include <algorithm>
#include <limits>

#include "ray.h"

namespace bsp {

/// A ray in an accelerator's units: finite, the largest component of its direction from 2^-60 to 2^60. Where there can
/// be no hit its maxt is below 0.
struct ScaledRay {
    __m128 o, d;  ///< in registers: see `load_each`; the fourth number of d is maxt
    double per_t; ///< the user's t for 1 of this ray's

    Ray ray() const { return {{o[0], o[1], o[2]}, {d[0], d[1], d[2]}, d[3]}; }
};

/// Whoever asks has just stored the ray, number by number. A load of several at once, which the compiler likes, would
/// have to wait until these stores have reached the cache: a tenth of a ray's time.
[[gnu::always_inline]] inline __m128 load_each(const float &a, const float &b, const float &c, const float &d) {
    __m128 v;
    asm("vmovss %1, %0\n\t"
        "vinsertps $0x10, %2, %0, %0\n\t"
        "vinsertps $0x20, %3, %0, %0\n\t"
        "vinsertps $0x30, %4, %0, %0"
        : "=&x"(v)
        : "m"(a), "m"(b), "m"(c), "m"(d));
    return v;
}

inline Hit in_users_units(Hit hit, double per_t) {
    hit.t = float(double(hit.t) * per_t);
    return hit;
}
inline bool in_users_units(bool found, double) { return found; }

class Scale {
public:
    /// Changes nothing.
    Scale() : Scale(0) {}

    /// For coordinates of at most this size: they become less than 1 and at least 1/2, as far as the factor and its
    /// inverse are normal floats. What was above 2^126 becomes up to 4, what was below 2^-127 stays below 1/2.
    static Scale for_largest(double size);

    float apply(float x) const { return x * m_factor; }
    double apply(double x) const { return x / m_inverse; }
    double undo(double x) const { return x * m_inverse; }

    /// A ray that is not finite, has no direction or no interval, or begins more than 2^96 scenes away, hits nothing.
    /// Hits get a t that is finite and not above the user's maxt.
    [[gnu::always_inline]] ScaledRay apply(const Ray &ray) const noexcept {
        const __m128 sign = _mm_set1_ps(-0.0f), factor = _mm_set1_ps(m_factor);
        const __m128 o = _mm_mul_ps(load_each(ray.o.x, ray.o.y, ray.o.z, ray.o.z), factor);
        const __m128 d = load_each(ray.d.x, ray.d.y, ray.d.z, ray.maxt);
        const __m128 distance = _mm_andnot_ps(sign, o), speed = _mm_andnot_ps(sign, d);
        const __m128 usual =
            _mm_and_ps(_mm_cmple_ps(distance, _mm_set1_ps(farthest)), _mm_cmple_ps(speed, _mm_set1_ps(m_fastest)));
        const bool moves = (_mm_movemask_ps(_mm_cmpge_ps(speed, _mm_set1_ps(slowest))) & 7) != 0;
        const __m128 end = _mm_min_ps(_mm_set1_ps(m_end), _mm_mul_ps(d, factor)); // the second, if it is not a number
        // The smallest normal number itself may have been rounded up to.
        const bool lasts = (_mm_movemask_ps(_mm_cmpgt_ps(end, _mm_set1_ps(smallest_normal))) & 8) != 0;
        if (__builtin_expect(((_mm_movemask_ps(usual) & 7) == 7) & moves & lasts, true))
            return {o, _mm_blend_ps(d, end, 8), m_inverse};
        return apply_with_care(ray);
    }

private:
    static constexpr float farthest = 0x1p96f, slowest = 0x1p-60f, fastest = 0x1p60f;
    static constexpr float smallest_normal = std::numeric_limits<float>::min();

    /// The factor is 2^-exponent.
    explicit Scale(int exponent);
    /// Any ray, denormal numbers included, even in a thread that flushes them to zero.
    ScaledRay apply_with_care(const Ray &ray) const noexcept;

    float m_factor;
    float m_fastest; ///< below 0 where every ray needs care
    float m_end;     ///< the largest maxt whose counterpart is finite
    double m_inverse;
};

} // namespace bsp
