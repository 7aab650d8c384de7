// One line "count,force,a1,a2,a3" a sample, 250 a second: what docs/recipes/arduino.md reads over USB.
const float kForce = 0.0125f, kAccel = 0.0958f; // N and m/s^2 a code of your sensors
unsigned long next_us = 0;
unsigned int count = 0; // wraps at 65,536: counter_bits = 16

void setup() {
    Serial.begin(115200);
    next_us = micros();
}

void loop() {
    if ((long)(micros() - next_us) < 0) return;
    next_us += 4000; // an absolute deadline: a late sample does not delay the next one
    const int force = analogRead(A0), a1 = analogRead(A1), a2 = analogRead(A2), a3 = analogRead(A3);
    Serial.print(count++ & 0xFFFFu);
    Serial.print(',');
    Serial.print((force - 512) * kForce, 3);
    Serial.print(',');
    Serial.print((a1 - 512) * kAccel, 3);
    Serial.print(',');
    Serial.print((a2 - 512) * kAccel, 3);
    Serial.print(',');
    Serial.println((a3 - 512) * kAccel, 3);
}
