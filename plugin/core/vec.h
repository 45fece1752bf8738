/// Three-component vectors: the only linear algebra the library needs.
#pragma once

#include <cmath>
#include <cstddef>

namespace bsp {

template <typename T> struct Vec3 {
    T x{}, y{}, z{};

    T &operator[](std::size_t axis) { return (&x)[axis]; }
    T operator[](std::size_t axis) const { return (&x)[axis]; }

    Vec3 operator+(const Vec3 &o) const { return {x + o.x, y + o.y, z + o.z}; }
    Vec3 operator-(const Vec3 &o) const { return {x - o.x, y - o.y, z - o.z}; }
    Vec3 operator*(T s) const { return {x * s, y * s, z * s}; }
    bool operator==(const Vec3 &o) const { return x == o.x && y == o.y && z == o.z; }
};

using Vec3f = Vec3<float>;
using Vec3d = Vec3<double>;

template <typename T> T dot(const Vec3<T> &a, const Vec3<T> &b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

template <typename T> Vec3<T> cross(const Vec3<T> &a, const Vec3<T> &b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

template <typename T> T norm(const Vec3<T> &a) { return std::sqrt(dot(a, a)); }

inline Vec3d to_double(const Vec3f &v) { return {double(v.x), double(v.y), double(v.z)}; }

} // namespace bsp
