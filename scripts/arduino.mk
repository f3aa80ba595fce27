# The Arduino library, and sketches on simulated AVR boards.

# What the library carries: every archive that stands here, at least these.
AVR_ARCHIVES := $(patsubst %,$(BUILD)/archives/%/libmbm.a,atmega328p atmega2560)

.PHONY: arduino
arduino: $(AVR_ARCHIVES) ## The Arduino library: dist/mbm and its zip
	@scripts/arduino
	@scripts/check-arduino
