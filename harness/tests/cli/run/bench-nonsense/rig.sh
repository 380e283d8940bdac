#!/bin/sh
read -r request
echo lamp
