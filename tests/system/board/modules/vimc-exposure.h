/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What a real image sensor's driver lets be set, for vimc's sensor: exposure, gain, black level, and the rows that it does
 * not read out. They act as on a sensor, and show in the picture:
 *
 *     grey    = black + pattern x exposure x gain / (VIMC_EXPOSURE_ROWS x VIMC_GAIN_ONE), held to 255; of formats of 8 bits
 *     period  = (rows + blank rows) x (columns + VIMC_HBLANK) / VIMC_PIXEL_RATE, times 1 - ppm_K / 10^6 of device K
 *     the exposure ends VIMC_MARGIN rows before the next frame at the latest: its range goes with the blank rows
 *
 * A value acts with the second frame that begins after it was set. A frame begins on an absolute grid, by which it is
 * stamped.
 */
#ifndef _VIMC_EXPOSURE_H_
#define _VIMC_EXPOSURE_H_

#include <linux/ktime.h>
#include <linux/spinlock.h>
#include <linux/version.h>
#include <media/v4l2-ctrls.h>

#define VIMC_PIXEL_RATE 12000000
#define VIMC_HBLANK 160
#define VIMC_VBLANK 20
#define VIMC_VBLANK_MAX 16000
#define VIMC_MARGIN 4
#define VIMC_EXPOSURE_ROWS 100
#define VIMC_GAIN_ONE 16

struct vimc_exposure_values {
    s32 exposure;
    s32 gain;
    s32 black;
    s32 blank;
};

struct vimc_exposure {
    struct v4l2_ctrl *exposure;
    struct v4l2_ctrl *blank;
    unsigned int width;
    unsigned int height;
    const int *ppm;

    /* Under the lock: what was set, since when, and what was set before the frame that began last. */
    spinlock_t lock;
    struct vimc_exposure_values set;
    struct vimc_exposure_values before;
    u64 changed;
    u64 began;

    /* The streamer's. */
    struct vimc_exposure_values next;
    struct vimc_exposure_values acts;
};

static int vimc_exposure_s_ctrl(struct v4l2_ctrl *ctrl)
{
    struct vimc_exposure *e = ctrl->priv;

    spin_lock(&e->lock);
    if (e->changed <= e->began)
        e->before = e->set;
    e->changed = ktime_get_ns();
    switch (ctrl->id) {
    case V4L2_CID_EXPOSURE:
        e->set.exposure = ctrl->val;
        break;
    case V4L2_CID_ANALOGUE_GAIN:
        e->set.gain = ctrl->val;
        break;
    case V4L2_CID_BLACK_LEVEL:
        e->set.black = ctrl->val;
        break;
    case V4L2_CID_VBLANK:
        e->set.blank = ctrl->val;
        break;
    }
    spin_unlock(&e->lock);
    if (ctrl->id == V4L2_CID_VBLANK)
        return __v4l2_ctrl_modify_range(e->exposure, 1, e->height + ctrl->val - VIMC_MARGIN, 1,
                        VIMC_EXPOSURE_ROWS);
    return 0;
}

static const struct v4l2_ctrl_ops vimc_exposure_ops = {
    .s_ctrl = vimc_exposure_s_ctrl,
};

static struct v4l2_ctrl *vimc_exposure_control(struct vimc_exposure *e, struct v4l2_ctrl_handler *handler, u32 id,
                           s64 min, s64 max, u64 step, s64 def)
{
    struct v4l2_ctrl *ctrl = v4l2_ctrl_new_std(handler, &vimc_exposure_ops, id, min, max, step, def);

    if (ctrl)
        ctrl->priv = e;
    return ctrl;
}

static void vimc_exposure_init(struct vimc_exposure *e, struct v4l2_ctrl_handler *handler, unsigned int width,
                   unsigned int height, const int *ppm)
{
    struct v4l2_ctrl *fixed;

    spin_lock_init(&e->lock);
    e->width = width;
    e->height = height;
    e->ppm = ppm;
    e->set.exposure = VIMC_EXPOSURE_ROWS;
    e->set.gain = VIMC_GAIN_ONE;
    e->set.blank = VIMC_VBLANK;
    e->exposure = vimc_exposure_control(e, handler, V4L2_CID_EXPOSURE, 1, height + VIMC_VBLANK - VIMC_MARGIN, 1,
                        VIMC_EXPOSURE_ROWS);
    vimc_exposure_control(e, handler, V4L2_CID_ANALOGUE_GAIN, VIMC_GAIN_ONE, 16 * VIMC_GAIN_ONE, 2, VIMC_GAIN_ONE);
    vimc_exposure_control(e, handler, V4L2_CID_BLACK_LEVEL, 0, 64, 4, 0);
    e->blank = vimc_exposure_control(e, handler, V4L2_CID_VBLANK, VIMC_MARGIN, VIMC_VBLANK_MAX, 1, VIMC_VBLANK);
    fixed = vimc_exposure_control(e, handler, V4L2_CID_HBLANK, VIMC_HBLANK, VIMC_HBLANK, 1, VIMC_HBLANK);
    if (fixed)
        fixed->flags |= V4L2_CTRL_FLAG_READ_ONLY;
    vimc_exposure_control(e, handler, V4L2_CID_PIXEL_RATE, VIMC_PIXEL_RATE, VIMC_PIXEL_RATE, 1, VIMC_PIXEL_RATE);
}

/* The sensor has another size. From Linux 6.7 on the lock of its controls is that of its state, and held. */
static void vimc_exposure_size(struct vimc_exposure *e, unsigned int width, unsigned int height)
{
    e->width = width;
    e->height = height;
#if LINUX_VERSION_CODE >= KERNEL_VERSION(6, 7, 0)
    __v4l2_ctrl_modify_range(e->exposure, 1, height + e->blank->cur.val - VIMC_MARGIN, 1, VIMC_EXPOSURE_ROWS);
#else
    v4l2_ctrl_modify_range(e->exposure, 1, height + e->blank->cur.val - VIMC_MARGIN, 1, VIMC_EXPOSURE_ROWS);
#endif
}

static void vimc_exposure_start(struct vimc_exposure *e)
{
    spin_lock(&e->lock);
    e->acts = e->next = e->set;
    e->began = ktime_get_ns();
    spin_unlock(&e->lock);
}

/* A frame begins at that time. */
static void vimc_exposure_begin(struct vimc_exposure *e, u64 at)
{
    e->acts = e->next;
    spin_lock(&e->lock);
    e->next = e->changed < at ? e->set : e->before;
    e->began = at;
    spin_unlock(&e->lock);
}

/* From the frame that has begun to the next. */
static u64 vimc_exposure_period(const struct vimc_exposure *e)
{
    u64 pixels = (u64)(e->width + VIMC_HBLANK) * (e->height + e->acts.blank);
    u64 ns = div_u64(pixels * 1000, VIMC_PIXEL_RATE / 1000000);

    return ns - div_s64((s64)ns * *e->ppm, 1000000);
}

static void vimc_exposure_show(const struct vimc_exposure *e, u8 *frame, unsigned int bytes)
{
    u64 light = (u64)e->acts.exposure * e->acts.gain;
    unsigned int i;
    u8 table[256];

    if (light == VIMC_EXPOSURE_ROWS * VIMC_GAIN_ONE && !e->acts.black)
        return;
    for (i = 0; i < ARRAY_SIZE(table); i++)
        table[i] = min_t(u64, 255, e->acts.black + div_u64(i * light, VIMC_EXPOSURE_ROWS * VIMC_GAIN_ONE));
    for (i = 0; i < bytes; i++)
        frame[i] = table[frame[i]];
}

#endif
