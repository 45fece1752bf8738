#include "sorting.h"

#include <algorithm>
#include <array>

namespace bsp {
namespace {

/// Unsigned integers in the order of the floats they stand for.
std::uint32_t key_of(float value) {
    std::uint32_t bits;
    std::memcpy(&bits, &value, sizeof bits);
    return bits ^ (std::uint32_t(-std::int32_t(bits >> 31)) | 0x80000000u);
}

constexpr std::size_t digit_count = 3, digit_bits = 11, bucket_count = std::size_t(1) << digit_bits;

std::uint32_t digit_of(float value, std::size_t digit) {
    return (key_of(value) >> (digit * digit_bits)) & std::uint32_t(bucket_count - 1);
}

} // namespace

void sort_floats(std::vector<float> &values, std::vector<float> &scratch) {
    constexpr std::size_t few = 1024;
    if (values.size() < few) {
        std::sort(values.begin(), values.end());
        return;
    }
    std::array<std::array<std::uint32_t, bucket_count>, digit_count> counts{};
    for (const float value : values)
        for (std::size_t digit = 0; digit < digit_count; ++digit)
            ++counts[digit][digit_of(value, digit)];
    scratch.resize(values.size());
    for (std::size_t digit = 0; digit < digit_count; ++digit) {
        std::uint32_t start = 0;
        for (std::uint32_t &count : counts[digit]) {
            const std::uint32_t size = count;
            count = start;
            start += size;
        }
        for (const float value : values)
            scratch[counts[digit][digit_of(value, digit)]++] = value;
        values.swap(scratch);
    }
}

} // namespace bsp
