# The attitude step of a firmware, generated and held to its contract on every build.
#
# Put this file beside your Makefile and say there:
#     ATTITUDE = euler
#     ATTITUDE_OPTIONS = --target c-fixed --word 32 --max-rate-deg-s 400 --step 0.01
#     include strapgen.mk
# or use it by itself: make -f strapgen.mk attitude-generate attitude-vectors

STRAPGEN ?= strapgen
# The command of strapgen that generates: generate, two-speed or system.
ATTITUDE_COMMAND ?= generate
# The algorithm, or the file of a system, and what the command takes beside it.
ATTITUDE ?= euler
ATTITUDE_OPTIONS ?= --target c-fixed --word 32 --max-rate-deg-s 400 --step 0.01
# The folder that holds the generated files and nothing else of yours.
ATTITUDE_FOLDER ?= firmware
ATTITUDE_SOURCES = $(filter-out %/main.c $(ATTITUDE_FOLDER)/test_%,$(wildcard $(ATTITUDE_FOLDER)/*.c))
# The largest error on coning that the firmware may have, in rad.
ATTITUDE_FAIL_ABOVE ?= 1e-7
# What it is compared as: the algorithm, or a system; of two speeds the built-in one with the same loops.
ATTITUDE_COMPARED ?= $(if $(filter two-speed,$(ATTITUDE_COMMAND)),two-speed-$(ATTITUDE)$(ATTITUDE_FORM),$(ATTITUDE))
ATTITUDE_FORM = $(if $(filter 1,$(call attitude_option,sculling)),-1)
ATTITUDE_FILES = $(if $(filter generate,$(ATTITUDE_COMMAND)),$(addprefix --source ,$(ATTITUDE_SOURCES)) \
  --fail-above $(ATTITUDE_FAIL_ABOVE),--source $(ATTITUDE_FOLDER))
# The step of that run in s: that of the options, or as many samples of the gyro as a step takes, 2 unless they say;
# of two speeds and of systems one sample, at the rate of the system's file unless they say.
attitude_option = $(patsubst --$(1)=%,%,$(filter --$(1)=%,$(subst --$(1) ,--$(1)=,$(ATTITUDE_OPTIONS))))
attitude_count = $(if $(filter generate,$(ATTITUDE_COMMAND)),$(or $(call attitude_option,increments),2),1)
attitude_samples = $(attitude_count)/$(call attitude_option,sample-hz)
attitude_usual = $(if $(filter generate,$(ATTITUDE_COMMAND)),0.01)
ATTITUDE_STEP ?= $(or $(call attitude_option,step),$(if $(call attitude_option,sample-hz),$(attitude_samples)),$(attitude_usual))
# A system has no project of its own, and so no vectors.
ATTITUDE_PROJECT = $(if $(filter system,$(ATTITUDE_COMMAND)),,--project)

.PHONY: attitude-generate attitude-check attitude-verify attitude-compare attitude-vectors attitude-vectors-m3

# Writes the step, what builds it with CMake, and a test of vectors.
attitude-generate:
	$(STRAPGEN) $(ATTITUDE_COMMAND) $(ATTITUDE) $(ATTITUDE_OPTIONS) $(ATTITUDE_PROJECT) --out $(ATTITUDE_FOLDER)

# Fails if the files in the folder are not those that the options generate.
attitude-check:
	$(STRAPGEN) $(ATTITUDE_COMMAND) $(ATTITUDE) $(ATTITUDE_OPTIONS) --check --out $(ATTITUDE_FOLDER)

# Fails if a file was edited, or does not do what its header says: it is compiled and run as it stands.
attitude-verify:
	for file in $(ATTITUDE_SOURCES); do \
	  $(STRAPGEN) verify $$file || exit 1; \
	done

# Fails if the arithmetic of a step leaves that of 40 digits by more than you allow, and a pass of a system its certified
# bound. Of two speeds you see the difference, and attitude-verify holds every loop to its bound.
attitude-compare:
	$(STRAPGEN) compare $(ATTITUDE_COMPARED) $(ATTITUDE_FILES) --reference exact \
	  --motion coning --set a_deg_s=10 b_deg_s=10 g_deg_s=10 $(addprefix --step ,$(ATTITUDE_STEP)) --duration 20

# Fails if a call on this machine does not return the very integers of the vectors.
attitude-vectors:
	cmake -S $(ATTITUDE_FOLDER) -B $(ATTITUDE_FOLDER)/build
	cmake --build $(ATTITUDE_FOLDER)/build
	ctest --test-dir $(ATTITUDE_FOLDER)/build --output-on-failure

# The same on an emulated Cortex-M3, with arm-none-eabi-gcc, picolibc and QEMU.
M3 = arm-none-eabi-gcc -mcpu=cortex-m3 -mthumb -O2 -std=c99 -ffp-contract=off \
  --specs=picolibc.specs --oslib=semihost --crt0=hosted \
  -Wl,--defsym=__flash=0 -Wl,--defsym=__flash_size=0x400000 \
  -Wl,--defsym=__ram=0x20000000 -Wl,--defsym=__ram_size=0x400000
M3_RUN = qemu-system-arm -M mps2-an385 -display none -monitor none -serial none \
  -semihosting-config enable=on,target=native -kernel

attitude-vectors-m3:
	mkdir -p $(ATTITUDE_FOLDER)/build
	for test in $(wildcard $(ATTITUDE_FOLDER)/test_*.c); do \
	  $(M3) -I $(ATTITUDE_FOLDER) -o $(ATTITUDE_FOLDER)/build/m3.elf $$test $(ATTITUDE_SOURCES) -lm && \
	  $(M3_RUN) $(ATTITUDE_FOLDER)/build/m3.elf || exit 1; \
	done
