/// Eight floats at once, with exactly the operations that the triangle tests need. Never contracted, never reordered.
#pragma once

#include <immintrin.h>

namespace bsp {

/// Marks a function that uses AVX-512 on eight lanes.
#define BSP_AVX512 __attribute__((target("avx512f,avx512vl,avx512dq,avx512bw")))

inline bool has_avx512() {
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
           __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw");
}

struct Float8 {
    __m256 v;

    static constexpr int width = 8;
    static Float8 load(const float *p) { return {_mm256_load_ps(p)}; }
    static Float8 all(float x) { return {_mm256_set1_ps(x)}; }

    Float8 operator+(Float8 o) const { return {_mm256_add_ps(v, o.v)}; }
    Float8 operator-(Float8 o) const { return {_mm256_sub_ps(v, o.v)}; }
    Float8 operator*(Float8 o) const { return {_mm256_mul_ps(v, o.v)}; }
    Float8 operator/(Float8 o) const { return {_mm256_div_ps(v, o.v)}; }
    Float8 operator&(Float8 o) const { return {_mm256_and_ps(v, o.v)}; }
    Float8 operator|(Float8 o) const { return {_mm256_or_ps(v, o.v)}; }
    Float8 operator^(Float8 o) const { return {_mm256_xor_ps(v, o.v)}; }
    Float8 and_not(Float8 o) const { return {_mm256_andnot_ps(o.v, v)}; }
    Float8 operator<(Float8 o) const { return {_mm256_cmp_ps(v, o.v, _CMP_LT_OQ)}; }
    Float8 operator<=(Float8 o) const { return {_mm256_cmp_ps(v, o.v, _CMP_LE_OQ)}; }
    Float8 operator>(Float8 o) const { return {_mm256_cmp_ps(v, o.v, _CMP_GT_OQ)}; }
    Float8 operator>=(Float8 o) const { return {_mm256_cmp_ps(v, o.v, _CMP_GE_OQ)}; }
    Float8 operator[](__m256i lanes) const { return {_mm256_permutevar8x32_ps(v, lanes)}; }
    /// One bit per lane, set where a comparison was true.
    unsigned bits() const { return unsigned(_mm256_movemask_ps(v)); }
};

inline Float8 min(Float8 a, Float8 b) { return {_mm256_min_ps(a.v, b.v)}; }
inline Float8 max(Float8 a, Float8 b) { return {_mm256_max_ps(a.v, b.v)}; }
inline Float8 fmadd(Float8 a, Float8 b, Float8 c) { return {_mm256_fmadd_ps(a.v, b.v, c.v)}; }
inline Float8 fmsub(Float8 a, Float8 b, Float8 c) { return {_mm256_fmsub_ps(a.v, b.v, c.v)}; }
inline Float8 fnmadd(Float8 a, Float8 b, Float8 c) { return {_mm256_fnmadd_ps(a.v, b.v, c.v)}; }

inline float fmadd(float a, float b, float c) { return __builtin_fmaf(a, b, c); }
inline float fmsub(float a, float b, float c) { return __builtin_fmaf(a, b, -c); }

} // namespace bsp
