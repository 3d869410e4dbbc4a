"""Parts of made-up URDF files."""

LIMIT = '<limit effort="5" velocity="10" {}/>'


def box(name, size="0.6 0.4 0.2", at="0 0 0.2"):
    shape = f'<collision><origin xyz="{at}"/><geometry><box size="{size}"/></geometry></collision>'
    return f'<link name="{name}"><inertial><mass value="10"/></inertial>{shape}</link>'


def joint(name, child, at, kind="continuous", axis="0 1 0", parent="base", more=""):
    axis = f'<axis xyz="{axis}"/>' if axis else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><origin xyz="{at}"/>{axis}{more}'
        "</joint>"
    )


def wheel(name, x, y, radius=0.1, parent="base", z=None, shape="cylinder", mesh="", joint_name=None):
    """A wheel with its joint."""
    geometry = f'<{shape} radius="{radius}"' + (' length="0.04"/>' if shape == "cylinder" else "/>")
    drawn = f'<visual><geometry><mesh filename="{mesh}"/></geometry></visual>' if mesh else ""
    link = f'<link name="{name}">{drawn}<collision><origin rpy="1.5708 0 0"/><geometry>{geometry}</geometry></collision></link>'
    return link + joint(joint_name or f"{name}_joint", name, f"{x} {y} {radius if z is None else z}", parent=parent)


def pair(x=0.0, prefix="", **how):
    return wheel(f"{prefix}left_wheel", x, 0.22, **how) + wheel(f"{prefix}right_wheel", x, -0.22, **how)


def robot(*parts, name="made_up"):
    return f'<robot name="{name}" xmlns:xacro="http://www.ros.org/wiki/xacro">{"".join(parts)}</robot>'
