/* A flight on a Cortex-M3: takes the steps and reports the state every second, as a line of the
 * log states.csv. With FLIP_STEP a bit of the state changes in memory after that step.
 */
#include "euler_rk4_2_w32.h"
#include "flight.h"

/* Semihosting, which QEMU answers: an operation, and the address of what it takes. */
static int host(int operation, const void *argument)
{
    register int r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

static void print(const char *text) { (void)host(0x04, text); }

static void print_number(int32_t number)
{
    char text[13];
    char *place = text + sizeof(text) - 1;
    uint32_t size = (number < 0) ? (0u - (uint32_t)number) : (uint32_t)number;
    *place = '\0';
    do {
        *--place = (char)('0' + (size % 10u));
        size /= 10u;
    } while (size != 0u);
    if (number < 0) {
        *--place = '-';
    }
    print(place);
}

static void report(int second, const int32_t state[4])
{
    print_number(second);
    for (int k = 0; k < 4; ++k) {
        print(",");
        print_number(state[k]);
    }
    print("\n");
}

void start(void)
{
    int32_t state[4] = {0, 0, 0, INT32_C(1) << 30};
    print("time_s,e_x,e_y,e_z,e_s\n");
    report(0, state);
    for (int step = 1; step <= STEPS; ++step) {
        if (euler_rk4_2_w32(state, flight[step - 1], state) != 0) {
            print("refused\n");
            break;
        }
#ifdef FLIP_STEP
        if (step == FLIP_STEP) {
            state[1] ^= INT32_C(1) << 12;
        }
#endif
        if (step % 100 == 0) {
            report(step / 100, state);
        }
    }
    (void)host(0x18, (const void *)0x20026); /* the application exits */
    for (;;) {
    }
}

/* The first words of the memory: the top of the stack, and where the processor starts. */
extern uint32_t stack_top;
__attribute__((section(".vectors"), used)) static const void *const vectors[2] = {
    &stack_top, (const void *)start};
