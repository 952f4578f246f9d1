// SPDX-License-Identifier: GPL-2.0
/*
 * A PWM chip for a board that has none: a device for Linux's pwm-gpio (from 6.11 on), which toggles a line of the board's
 * PL061 by a timer. gpio-sim will not do: its lines may sleep.
 */
#include <linux/err.h>
#include <linux/gpio/machine.h>
#include <linux/module.h>
#include <linux/platform_device.h>

static struct gpiod_lookup_table board_pwm_line = {
    .dev_id = "pwm-gpio",
    .table = {GPIO_LOOKUP("9030000.pl061", 5, NULL, GPIO_ACTIVE_HIGH), {}},
};
static struct platform_device *board_pwm;

static int __init board_pwm_init(void)
{
    gpiod_add_lookup_table(&board_pwm_line);
    board_pwm = platform_device_register_simple("pwm-gpio", PLATFORM_DEVID_NONE, NULL, 0);
    if (IS_ERR(board_pwm))
        gpiod_remove_lookup_table(&board_pwm_line);
    return PTR_ERR_OR_ZERO(board_pwm);
}

static void __exit board_pwm_exit(void)
{
    platform_device_unregister(board_pwm);
    gpiod_remove_lookup_table(&board_pwm_line);
}

module_init(board_pwm_init);
module_exit(board_pwm_exit);
MODULE_DESCRIPTION("A PWM chip for the emulated board");
MODULE_LICENSE("GPL");
