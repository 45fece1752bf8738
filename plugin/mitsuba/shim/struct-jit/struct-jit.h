/// Stands in for a header that Mitsuba's wheel leaves out: `core/struct.h`, and so `mesh.h`, want these three names.
#pragma once

namespace struct_jit {

enum class Type { Float16, Float32, Float64, Int8, Int16, Int32, Int64, UInt8, UInt16, UInt32, UInt64, Invalid };

template <typename T> struct type_id {
    static constexpr Type value = Type::Invalid;
};

template <typename T> constexpr Type type_v = type_id<T>::value;

} // namespace struct_jit
