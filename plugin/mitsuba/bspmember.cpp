/// The shape `bspmember`: puts one member of a group in its own place among a scene's objects. Mitsuba moves what a
/// group expands to behind the other objects, and the order of emitters decides which random number picks which light.
/// Properties: `group`, a bsptree or nativekdtree with expand=false; `index`, the number of the group's child.
#include "member.h"
#include "variants.h"

NAMESPACE_BEGIN(mitsuba)

template <typename Float, typename Spectrum> class BSPMember final : public Shape<Float, Spectrum> {
public:
    MI_IMPORT_BASE(Shape)
    MI_IMPORT_TYPES()

    explicit BSPMember(const Properties &props) {
        Group<Float, Spectrum> *group = nullptr;
        for (auto &prop : props.objects())
            group = dynamic_cast<Group<Float, Spectrum> *>(prop.template get<ref<Object>>().get());
        if (group == nullptr)
            Throw("the property \"group\" of a bspmember is a bsptree or nativekdtree with expand=false");
        check_names(props, "a bspmember", {"group", "index"});
        if (!props.has_property("index") || props.type("index") != Properties::Type::Integer)
            Throw("the property \"index\" of a bspmember is the number of one of its group's children");
        const int64_t index = props.get<int64_t>("index");
        if (index < 0 || size_t(index) >= group->child_count())
            Throw("a bspmember has index %d, but its group has %d children", index, group->child_count());
        m_member = group->member(size_t(index));
    }

    std::vector<ref<Object>> expand() const override { return {m_member}; }
    ScalarBoundingBox3f bbox() const override { return ScalarBoundingBox3f(); }

    MI_DECLARE_CLASS(BSPMember)

private:
    ref<Object> m_member;
};

BSP_EXPORT_PLUGIN(BSPMember)

NAMESPACE_END(mitsuba)
