#!/usr/bin/env python3
"""Makes modules of a board out of files of Linux 6.1 or 6.12, in place.

    adapt.py FOLDER      with irq_sim.c and vimc/

irq_sim is no module there, and calls irq_to_desc(), which modules may not: the way through irq_get_irq_data() is open.
vimc has one device; libcamera takes one camera from a media device. vimc.n_devs makes as many as are wanted. From 0.4 on
libcamera has its sensor draw the largest frames that there are, whatever was asked for, one a second in an emulator: those
are smaller here. vimc's sensor has none of the controls of a real one, and its frames come when the last one is done: it
has them by vimc-exposure.h, and frames on a grid; vimc.ppm is by how much the crystal of each device is fast.
"""
import pathlib
import re
import sys

STREAM = """    const struct vimc_ent_device *source = stream->ved_pipeline[stream->pipe_size - 1];
    u64 due = ktime_get_ns();

    set_freezable();

    for (;;) {
        ktime_t until;

        try_to_freeze();
        if (kthread_should_stop())
            break;

        for (i = stream->pipe_size - 1; i >= 0; i--) {
            stream->ved_pipeline[i]->begins = due;
            frame = stream->ved_pipeline[i]->process_frame(
                    stream->ved_pipeline[i], frame);
            if (!frame || IS_ERR(frame))
                break;
        }
        due = max(due + source->period, ktime_get_ns());
        until = ns_to_ktime(due);
        set_current_state(TASK_UNINTERRUPTIBLE);
        schedule_hrtimeout(&until, HRTIMER_MODE_ABS);
    }
"""

SHOW = """    vimc_exposure_show(&vsensor->exposure, vsensor->frame,
               vimc_sensor_has_bytes(vsensor) ?
               vsensor->tpg.bytesperline[0] * vsensor->tpg.buf_height : 0);

    return vsensor->frame;
}
"""

HAS_BYTES = """/* A picture whose components have 8 bits each. */
static bool vimc_sensor_has_bytes(const struct vimc_sensor_device *vsensor)
{
    switch (vsensor->tpg.fourcc) {
    case V4L2_PIX_FMT_RGB24:
    case V4L2_PIX_FMT_BGR24:
    case V4L2_PIX_FMT_SBGGR8:
    case V4L2_PIX_FMT_SGBRG8:
    case V4L2_PIX_FMT_SGRBG8:
    case V4L2_PIX_FMT_SRGGB8:
        return true;
    }
    return false;
}

static void *vimc_sensor_process_frame("""

VIMC_INIT = """static unsigned int n_devs = 1;
module_param(n_devs, uint, 0444);
static struct platform_device *vimc_pdevs[8];
int vimc_ppm[8];
module_param_array_named(ppm, vimc_ppm, int, NULL, 0644);

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
    text = change(text, r"struct vimc_ent_device \{\n", "struct vimc_ent_device {\n\tu64 begins; /* its frame */\n\tu64 period;\n",
                  path)
    path.write_text(text)

    path = folder / "vimc/vimc-streamer.c"
    text = path.read_text()
    text = change(text, r"\tset_freezable\(\);\n.*?schedule_timeout\(HZ / 60\);\n\t\}\n", STREAM, path)
    text = change(text, r"#include <linux/freezer\.h>\n", "#include <linux/freezer.h>\n#include <linux/hrtimer.h>\n", path)
    path.write_text(text)

    path = folder / "vimc/vimc-capture.c"
    text = path.read_text()
    path.write_text(change(text, r"ktime_get_ns\(\)", "vcapture->ved.begins", path))

    path = folder / "vimc/vimc-sensor.c"
    text = path.read_text()
    text = change(text, r'#include "vimc-common\.h"\n',
                  '#include "vimc-common.h"\n#include "vimc-exposure.h"\n\nextern int vimc_ppm[8];\n', path)
    text = change(text, r"\tstruct v4l2_ctrl_handler hdl;\n",
                  "\tstruct v4l2_ctrl_handler hdl;\n\tstruct vimc_exposure exposure;\n", path)
    text = change(text, r"\t\*mf = fmt->format;\n",
                  "\t*mf = fmt->format;\n\tif (fmt->which == V4L2_SUBDEV_FORMAT_ACTIVE)\n"
                  "\t\tvimc_exposure_size(&vsensor->exposure, mf->width, mf->height);\n", path)
    text = change(text, r"static void \*vimc_sensor_process_frame\(", HAS_BYTES, path)
    text = change(text, r"\ttpg_fill_plane_buffer\(",
                  "\tvimc_exposure_begin(&vsensor->exposure, ved->begins);\n"
                  "\tved->period = vimc_exposure_period(&vsensor->exposure);\n\ttpg_fill_plane_buffer(", path)
    text = change(text, r"\treturn vsensor->frame;\n\}\n", SHOW, path)
    text = change(text, r"\t\tvsensor->frame = vmalloc\(frame_size\);\n",
                  "\t\tvimc_exposure_start(&vsensor->exposure);\n\t\tvsensor->frame = vmalloc(frame_size);\n", path)
    text = change(text, r"\tvsensor->sd\.ctrl_handler = &vsensor->hdl;\n",
                  "\tvimc_exposure_init(&vsensor->exposure, &vsensor->hdl, fmt_default.width, fmt_default.height,\n"
                  "\t\t\t   &vimc_ppm[to_platform_device(vimc->mdev.dev)->id]);\n"
                  "\tvsensor->sd.ctrl_handler = &vsensor->hdl;\n", path)
    text = change(text, r"#include <linux/vmalloc\.h>\n",
                  "#include <linux/platform_device.h>\n#include <linux/vmalloc.h>\n", path)
    path.write_text(text)


main()
