#!/usr/bin/env python3
"""Makes modules of a board out of files of Linux 6.1 or 6.12, in place.

    adapt.py FOLDER      with irq_sim.c and vimc/vimc-core.c

irq_sim is no module there, and calls irq_to_desc(), which modules may not: the way through irq_get_irq_data() is open.
vimc has one device; libcamera takes one camera from a media device. vimc.n_devs makes as many as are wanted. From 0.4 on
libcamera has its sensor draw the largest frames that there are, whatever was asked for, one a second in an emulator: those
are smaller here.
"""
import pathlib
import re
import sys

VIMC_INIT = """static unsigned int n_devs = 1;
module_param(n_devs, uint, 0444);
static struct platform_device *vimc_pdevs[8];

static int __init vimc_init(void)
{
    unsigned int i;

    for (i = 0; i < n_devs && i < ARRAY_SIZE(vimc_pdevs); i++)
        vimc_pdevs[i] = platform_device_register_simple(VIMC_PDEV_NAME, i, NULL, 0);
    return platform_driver_register(&vimc_pdrv);
}

static void __exit vimc_exit(void)
{
    unsigned int i;

    platform_driver_unregister(&vimc_pdrv);
    for (i = 0; i < ARRAY_SIZE(vimc_pdevs); i++)
        if (!IS_ERR_OR_NULL(vimc_pdevs[i]))
            platform_device_unregister(vimc_pdevs[i]);
}

"""


def change(text, pattern, replacement, where):
    """text with the one match of pattern replaced."""
    changed, count = re.subn(pattern, lambda _: replacement, text, flags=re.S)
    if count != 1:
        sys.exit(f"{where}: {count} places like {pattern!r}, want 1: is this Linux 6.1 or 6.12?")
    return changed


def main():
    folder = pathlib.Path(sys.argv[1])
    path = folder / "irq_sim.c"
    text = path.read_text()
    text = change(text, r"irq_to_desc\(irqnum\)", "irq_data_to_desc(irq_get_irq_data(irqnum))", path)
    text = change(text, r"#include <linux/irq_sim\.h>\n",
                  "#include <linux/irq_sim.h>\n#include <linux/irqdesc.h>\n#include <linux/module.h>\n", path)
    path.write_text(text + 'MODULE_LICENSE("GPL");\n')

    path = folder / "vimc/vimc-core.c"
    text = path.read_text()
    text = change(text, r"static void vimc_dev_release\(struct device \*dev\)\n\{\n\}\n", "", path)
    text = change(text, r"static struct platform_device vimc_pdev = \{.*?\n\};\n", "", path)
    text = change(text, r'"platform:%s", VIMC_PDEV_NAME\);', '"platform:%s", dev_name(&pdev->dev));', path)
    text = change(text, r"static int __init vimc_init\(void\).*(?=module_init\(vimc_init\))", VIMC_INIT, path)
    path.write_text(text)

    path = folder / "vimc/vimc-common.h"
    text = path.read_text()
    for name, value in (("WIDTH", 640), ("HEIGHT", 480)):
        text = change(text, rf"#define VIMC_FRAME_MAX_{name} \d+", f"#define VIMC_FRAME_MAX_{name} {value}", path)
    path.write_text(text)


main()
