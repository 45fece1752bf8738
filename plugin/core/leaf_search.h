/// The search through the triangles of a leaf, written once and included once for each instruction set: BSP_SIMD names
/// it, BSP_TARGET tells the compiler. Part of traversal.h.

namespace bsp {

template <> struct LeafSearch<BSP_SIMD> {
    /// Offers the triangles of a leaf's blocks to the query; true if the search is over. The ray enters the leaf at
    /// `begin`. All blocks are looked at before a triangle is decided, so that a leaf has one loop whose end must be
    /// guessed, not one for each block.
    template <Mode mode, typename Test, typename Query, typename Counting>
    [[gnu::always_inline]] BSP_TARGET static bool run(const TriangleBlock *block, std::uint32_t count, float begin,
                                                      const Test &test, Query &query, Counting counting) {
        if constexpr (Counting::counts) {
            ++counting.counters.leaves;
            for (std::uint32_t i = 0; i < count; ++i)
                counting.counters.triangle_tests += block[i].triangle_count();
        }
        // What is behind the ray's origin is nearly always found in the leaf where the ray begins. That is the first
        // leaf of a closest-hit ray, but any of an any-hit ray's, whose branch would be guessed wrongly more often than
        // the work is worth.
        const bool may_be_behind = sorts_out<Test> && (Query::is_any || !(begin > 0));
        constexpr std::uint32_t at_once = 64 / TriangleBlock::width;
        for (std::uint32_t now; count > 0; count -= now, block += now) {
            now = std::min(count, at_once);
            std::uint64_t lanes =
                may_be_behind ? collect<mode, true>(block, now, test) : collect<mode, false>(block, now, test);
            for (; lanes != 0; lanes &= lanes - 1) {
                const unsigned lane = unsigned(__builtin_ctzll(lanes));
                const TriangleBlock &owner = block[lane / TriangleBlock::width];
                const std::uint32_t id = owner.ids[lane % TriangleBlock::width];
                if (id == query.known())
                    continue;
                const TriangleHit hit = test.intersect(TriangleBlock::Lane{owner, lane % TriangleBlock::width});
                if (query.template offer<mode>(hit, id))
                    return true;
            }
        }
        return false;
    }

private:
    /// Whether the test can tell what is behind the origin.
    template <typename Test> static constexpr bool sorts_out = std::is_same_v<Test, WoopTest>;

    /// A set bit for every triangle that may be hit, of up to eight blocks.
    template <Mode mode, bool may_be_behind, typename Test>
    [[gnu::always_inline]] BSP_TARGET static std::uint64_t collect(const TriangleBlock *block, std::uint32_t count,
                                                                   const Test &test) {
        std::uint64_t lanes = 0;
        for (std::uint32_t i = 0; i < count; ++i)
            lanes |= std::uint64_t(candidates<mode, may_be_behind>(block[i], test)) << (TriangleBlock::width * i);
        return lanes;
    }

    template <Mode mode, bool may_be_behind, typename Test>
    [[gnu::always_inline]] BSP_TARGET static unsigned candidates(const TriangleBlock &block, const Test &test) {
        if constexpr (may_be_behind && sorts_out<Test>) {
            const WoopTest::Edges edges = test.edges(block);
            using Largest = LargestSize<BSP_SIMD>;
            constexpr float units = WoopTest::moment_units / (mode == Mode::small_moment ? 16 : 1);
            const Float8 behind =
                test.behind(edges, Largest::of(edges.x), Largest::of(edges.y), Largest::of(edges.z), units);
            return edges.inside().and_not(behind).bits();
        } else {
            return test.candidates(block);
        }
    }
};

} // namespace bsp
