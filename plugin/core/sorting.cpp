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

/// Radix sort, from the lowest of `digit_count` digits on; those that all values share take no pass.
template <std::size_t digit_count> void sort_by_digits(std::vector<float> &values, std::vector<float> &scratch) {
    constexpr std::size_t digit_bits = (32 + digit_count - 1) / digit_count;
    constexpr std::size_t bucket_count = std::size_t(1) << digit_bits;
    const auto digit_of = [](float value, std::size_t digit) {
        return (key_of(value) >> (digit * digit_bits)) & std::uint32_t(bucket_count - 1);
    };
    std::array<std::array<std::uint32_t, bucket_count>, digit_count> counts{};
    for (const float value : values)
        for (std::size_t digit = 0; digit < digit_count; ++digit)
            ++counts[digit][digit_of(value, digit)];
    scratch.resize(values.size());
    for (std::size_t digit = 0; digit < digit_count; ++digit) {
        if (counts[digit][digit_of(values[0], digit)] == values.size())
            continue;
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

} // namespace

void sort_floats(std::vector<float> &values, std::vector<float> &scratch) {
    constexpr std::size_t few = 64, many = 1024; // where the next way becomes the fastest
    if (values.size() < few)
        std::sort(values.begin(), values.end());
    else if (values.size() < many)
        sort_by_digits<4>(values, scratch);
    else
        sort_by_digits<3>(values, scratch);
}

} // namespace bsp
