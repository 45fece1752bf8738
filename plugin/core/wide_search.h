/// The search through wide nodes, written once and included once for each instruction set: BSP_SIMD names it,
/// BSP_TARGET tells the compiler. Part of wide_traversal.h.

namespace bsp {

template <> struct WideSearch<BSP_SIMD> {
    using Lanes = WideLanes<BSP_SIMD>;

    template <Mode mode, typename Test, typename Query, typename Counting>
    BSP_TARGET static void run(const WideLayout &layout, const Ray &ray, Query &query, Counting counting) {
        if constexpr (Counting::counts)
            ++counting.counters.rays;
        const WideRay<mode> wide(ray, layout.box, layout.plane_tolerance);
        if (!(wide.entry <= wide.exit))
            return;
        const Test test(ray);

        // At most seven wait at each of the levels, and large leaves add some.
        WideStack<mode == Mode::short_stack ? 8 : 7 * (depth_limit / 3 + 16)> stack;
        WideCell cell{layout.root, wide.entry, wide.exit};
        for (;;) {
            if (!cell.child.is_leaf()) {
                const WideLine *const line = layout.lines.data() + cell.child.index();
                const bool is_oblique = cell.child.is_oblique();
                if constexpr (Counting::counts)
                    ++(is_oblique ? counting.counters.oblique_steps : counting.counters.axis_steps);
                const WideMeet meet =
                    is_oblique ? WideMeet::any(line->node, line[1].slopes, wide) : WideMeet::axes(line->node, wide);
                const WideCut cut = Lanes::cut(line->node, meet, cell.begin, cell.end);
                if (cut.lanes != 0) {
                    cell = descend<Query::is_any>(cut, stack);
                    continue;
                }
            } else if (visit_blocks<mode>(layout.blocks.data() + cell.child.index(), cell.child.block_count(), test,
                                          query, counting)) {
                return;
            }
            do {
                if (stack.empty())
                    return;
                cell = stack.pop();
            } while (!Query::is_any && cell.begin > query.limit());
            if (!Query::is_any)
                cell.end = std::min(cell.end, query.limit());
        }
    }

private:
    /// The cell to go on with: the nearest, or for any hit the farthest. A shadow ray starts on a surface, among what
    /// it has just missed; where it ends it is more likely to be stopped early. The others wait; there must be one.
    template <bool is_any, typename Stack>
    [[gnu::always_inline]] BSP_TARGET static WideCell descend(const WideCut &cut, Stack &stack) {
        alignas(32) std::uint32_t children[8];
        alignas(32) float begins[8], ends[8];
        _mm256_store_si256(reinterpret_cast<__m256i *>(children), cut.children);
        _mm256_store_ps(begins, cut.begin.v);
        _mm256_store_ps(ends, cut.end.v);
        const unsigned chosen = is_any ? unsigned(__builtin_ctz(cut.lanes)) : 31 - unsigned(__builtin_clz(cut.lanes));
        const unsigned others = cut.lanes ^ 1u << chosen;
        if (stack.has_room())
            stack.push(_mm256_castps_si256(Lanes::together({_mm256_castsi256_ps(cut.children)}, others).v),
                       Lanes::together(cut.begin, others), Lanes::together(cut.end, others),
                       __builtin_popcount(others));
        return {WideChild::in(children[chosen]), begins[chosen], ends[chosen]};
    }
};

} // namespace bsp
